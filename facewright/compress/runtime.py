"""The runtime as shader text: a low-resolution pass sums weight maps, the full-resolution pass reads six textures."""

GLSL = """// FaceZip runtime (WebGL 2 / GLSL ES 3.00), up to four 8-bit difference textures. Values: facezip.json.
// Pass 1, once for every expression with a weight, into an RGBA16F target of weight_size, additive (ONE, ONE):
//   outColor = facezipWeight(uv)
uniform sampler2D facezipWeightMap;
uniform vec4 facezipWeightStep, facezipWeightZero;   // weights[layer]; zero in codes, 0-255
uniform float facezipBeta;                           // weight of the expression
vec4 facezipWeight(vec2 uv) {
  return facezipBeta * (texture(facezipWeightMap, uv) * 255.0 - facezipWeightZero) * facezipWeightStep;
}

// Pass 2, in the material. All samplers: linear filter, clamp to edge, no sRGB decoding.
uniform sampler2D facezipNeutral, facezipD0, facezipD1, facezipD2, facezipD3, facezipSum;
uniform vec2 facezipUvScale;                         // weight_uv_scale
uniform vec3 facezipStep[4], facezipZero[4];         // differences[i]; step 0 for one that is missing
vec3 facezip(vec2 uv) {
  vec4 w = texture(facezipSum, uv * facezipUvScale);
  vec3 d = w.x * (texture(facezipD0, uv).rgb * 255.0 - facezipZero[0]) * facezipStep[0];
  d += w.y * (texture(facezipD1, uv).rgb * 255.0 - facezipZero[1]) * facezipStep[1];
  d += w.z * (texture(facezipD2, uv).rgb * 255.0 - facezipZero[2]) * facezipStep[2];
  d += w.w * (texture(facezipD3, uv).rgb * 255.0 - facezipZero[3]) * facezipStep[3];
  return clamp(texture(facezipNeutral, uv).rgb + d / 255.0, 0.0, 1.0);
}
"""

HLSL = """// FaceZip runtime (HLSL, Shader Model 5), up to four 8-bit difference textures. Values: facezip.json.
// uv has its origin at the top left of the image. Pass 1: additive into an RGBA16F target of weight_size.
Texture2D facezipWeightMap, facezipNeutral, facezipD0, facezipD1, facezipD2, facezipD3, facezipSum;
SamplerState facezipLinearClamp;
float4 facezipWeightStep, facezipWeightZero;
float facezipBeta;
float2 facezipUvScale;
float3 facezipStep[4], facezipZero[4];

float4 FacezipWeight(float2 uv) {
  float4 q = facezipWeightMap.Sample(facezipLinearClamp, uv) * 255.0;
  return facezipBeta * (q - facezipWeightZero) * facezipWeightStep;
}

float3 Facezip(float2 uv) {
  float4 w = facezipSum.Sample(facezipLinearClamp, uv * facezipUvScale);
  float3 d = w.x * (facezipD0.Sample(facezipLinearClamp, uv).rgb * 255.0 - facezipZero[0]) * facezipStep[0];
  d += w.y * (facezipD1.Sample(facezipLinearClamp, uv).rgb * 255.0 - facezipZero[1]) * facezipStep[1];
  d += w.z * (facezipD2.Sample(facezipLinearClamp, uv).rgb * 255.0 - facezipZero[2]) * facezipStep[2];
  d += w.w * (facezipD3.Sample(facezipLinearClamp, uv).rgb * 255.0 - facezipZero[3]) * facezipStep[3];
  return saturate(facezipNeutral.Sample(facezipLinearClamp, uv).rgb + d / 255.0);
}
"""
