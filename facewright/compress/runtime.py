"""The runtime as shader text: a low-resolution pass sums weight maps, the full-resolution pass reads six textures."""

GLSL = """// FaceZip runtime, GLSL ES 3.00 (WebGL 2). Every value is in facezip.json; see docs/compress-engines.md.
// Rows count from the top of the images: uv = (0, 0) is their upper left corner, and nothing is flipped on upload.
// No sampler decodes sRGB; all but the atlas filter linearly and clamp to the edge.

// Pass 1, once a frame, into a float target (RGBA16F or RGBA32F) of weight_size:
//   outColor = facezipWeights(ivec2(gl_FragCoord.xy));
#ifdef FACEZIP_PLACES                       // number of places of weight maps: places[0] * places[1]
uniform highp sampler2D facezipAtlas;       // weights.png or weights.ktx2
uniform ivec2 facezipWeightSize;            // weight_size
uniform int facezipAcross;                  // places[0]
uniform bool facezipThree;                  // three difference textures: four weight maps lie in three places
uniform vec4 facezipGain[FACEZIP_PLACES];   // at [place][channel]: 255 * step * weights of the expressions, summed
uniform vec4 facezipOffset;                 // sum over layers of step * weights * zero
vec4 facezipWeights(ivec2 cell) {
  vec4 sum = -facezipOffset;
  for (int n = 0; n < FACEZIP_PLACES; n++) {
    if (facezipGain[n] == vec4(0.0)) continue;
    ivec2 place = ivec2(n % facezipAcross, n / facezipAcross) * facezipWeightSize;
    vec4 part = facezipGain[n] * texelFetch(facezipAtlas, place + cell, 0);
    if (facezipThree) {                     // channel c is of difference (n + c) % 3
      part = vec4(part.x + part.w, part.y, part.z, 0.0);
      part = n % 3 == 0 ? part : n % 3 == 1 ? part.zxyw : part.yzxw;
    }
    sum += part;
  }
  return sum;
}
#else

// Pass 2, in the material: reads at most six textures.
uniform highp sampler2D facezipNeutral, facezipD0, facezipD1, facezipD2, facezipD3, facezipSum;
uniform highp vec2 facezipUvScale;          // weight_uv_scale
uniform highp vec4 facezipStep[4];          // differences[i].step, 0 for what is missing
uniform highp vec4 facezipZero[4];          // differences[i].zero / 255
highp vec4 facezip(highp vec2 uv) {
  highp vec4 w = texture(facezipSum, uv * facezipUvScale);
  highp vec4 d = w.x * facezipStep[0] * (texture(facezipD0, uv) - facezipZero[0]);
  d += w.y * facezipStep[1] * (texture(facezipD1, uv) - facezipZero[1]);
  d += w.z * facezipStep[2] * (texture(facezipD2, uv) - facezipZero[2]);
  d += w.w * facezipStep[3] * (texture(facezipD3, uv) - facezipZero[3]);
  return clamp(texture(facezipNeutral, uv) + d, 0.0, 1.0);
}
#endif
"""

HLSL = """// FaceZip runtime, HLSL (Shader Model 5). Every value is in facezip.json; see docs/compress-engines.md.
// uv = (0, 0) is the upper left corner of the images. No texture is sRGB; linear filter, clamp.
#ifndef FACEZIP_PLACES
#define FACEZIP_PLACES 64                    // at least the number of places of weight maps
#endif
Texture2D facezipAtlas, facezipNeutral, facezipD0, facezipD1, facezipD2, facezipD3, facezipSum;
SamplerState facezipLinearClamp;
cbuffer Facezip {
  float4 facezipGain[FACEZIP_PLACES];        // at [place][channel]: 255 * step * weights of the expressions, summed
  float4 facezipOffset;                      // sum over layers of step * weights * zero
  float4 facezipStep[4];                     // differences[i].step, 0 for what is missing
  float4 facezipZero[4];                     // differences[i].zero / 255
  float2 facezipUvScale;                     // weight_uv_scale
  int2 facezipWeightSize;                    // weight_size
  int2 facezipPlaces;                        // places
  int facezipThree;                          // 1 for three difference textures: four weight maps lie in three places
};

// Pass 1, once a frame, into a float target (R16G16B16A16_FLOAT) of weight_size; cell = SV_Position.xy.
float4 FacezipWeights(int2 cell) {
  float4 sum = -facezipOffset;
  for (int n = 0; n < facezipPlaces.x * facezipPlaces.y; n++) {
    int2 place = int2(n % facezipPlaces.x, n / facezipPlaces.x);
#ifdef FACEZIP_UPWARDS                       // rows count from below (Unity)
    place.y = facezipPlaces.y - 1 - place.y;
#endif
    float4 part = facezipGain[n] * facezipAtlas.Load(int3(place * facezipWeightSize + cell, 0));
    if (facezipThree) {                      // channel c is of difference (n + c) % 3
      part = float4(part.x + part.w, part.y, part.z, 0.0);
      part = n % 3 == 0 ? part : n % 3 == 1 ? part.zxyw : part.yzxw;
    }
    sum += part;
  }
  return sum;
}

// Pass 2, in the material: reads at most six textures.
float4 Facezip(float2 uv) {
  float2 at = uv * facezipUvScale;
#ifdef FACEZIP_UPWARDS                       // rows and v count from below (Unity)
  at.y += 1.0 - facezipUvScale.y;
#endif
  float4 w = facezipSum.Sample(facezipLinearClamp, at);
  float4 d = w.x * facezipStep[0] * (facezipD0.Sample(facezipLinearClamp, uv) - facezipZero[0]);
  d += w.y * facezipStep[1] * (facezipD1.Sample(facezipLinearClamp, uv) - facezipZero[1]);
  d += w.z * facezipStep[2] * (facezipD2.Sample(facezipLinearClamp, uv) - facezipZero[2]);
  d += w.w * facezipStep[3] * (facezipD3.Sample(facezipLinearClamp, uv) - facezipZero[3]);
  return saturate(facezipNeutral.Sample(facezipLinearClamp, uv) + d);
}
"""
