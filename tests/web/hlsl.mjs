// Runs the two passes of facezip.hlsl, translated to GLSL ES, in headless Chromium.
// node tests/web/hlsl.mjs JOB.json OUT
// JOB.json: passes (two fragment shaders), images (name -> width, height, RGBA bytes in base64), block (the bytes of the
// constant buffer, base64), cells (size of the weight target), size. OUT gets the RGBA bytes of the second pass, row 0 first.
import { readFileSync, writeFileSync } from 'node:fs';
import { chromium } from 'playwright-core';

const [file, out] = process.argv.slice(2);
if (!out) {
  console.error('usage: node tests/web/hlsl.mjs JOB.json OUT');
  process.exit(2);
}
function draw(job) {
  const gl = document.createElement('canvas').getContext('webgl2');
  for (const name of ['EXT_color_buffer_float', 'OES_texture_float_linear']) if (!gl.getExtension(name)) throw new Error(`no ${name}`);
  const bytes = (text) => Uint8Array.from(atob(text), (letter) => letter.charCodeAt(0));
  const vertex = `#version 300 es
    out highp vec2 uv;
    void main() { uv = vec2(gl_VertexID & 1, gl_VertexID >> 1) * 2.0; gl_Position = vec4(uv * 2.0 - 1.0, 0.0, 1.0); }`;
  const texture = (format, type, width, height, data, filter) => {
    const made = gl.createTexture();
    gl.bindTexture(gl.TEXTURE_2D, made);
    gl.texImage2D(gl.TEXTURE_2D, 0, format, width, height, 0, gl.RGBA, type, data);
    for (const side of [gl.TEXTURE_WRAP_S, gl.TEXTURE_WRAP_T]) gl.texParameteri(gl.TEXTURE_2D, side, gl.CLAMP_TO_EDGE);
    for (const way of [gl.TEXTURE_MIN_FILTER, gl.TEXTURE_MAG_FILTER]) gl.texParameteri(gl.TEXTURE_2D, way, filter);
    return made;
  };
  const textures = {};
  for (const [name, image] of Object.entries(job.images)) {
    const filter = name === 'facezipAtlas' ? gl.NEAREST : gl.LINEAR;
    textures[name] = texture(gl.RGBA8, gl.UNSIGNED_BYTE, image.width, image.height, bytes(image.data), filter);
  }
  const block = gl.createBuffer();
  gl.bindBufferBase(gl.UNIFORM_BUFFER, 0, block);
  gl.bufferData(gl.UNIFORM_BUFFER, bytes(job.block), gl.STATIC_DRAW);
  const run = (fragment, [width, height], target) => {
    const program = gl.createProgram();
    for (const [kind, source] of [[gl.VERTEX_SHADER, vertex], [gl.FRAGMENT_SHADER, fragment]]) {
      const shader = gl.createShader(kind);
      gl.shaderSource(shader, source);
      gl.compileShader(shader);
      if (!gl.getShaderParameter(shader, gl.COMPILE_STATUS)) throw new Error(gl.getShaderInfoLog(shader));
      gl.attachShader(program, shader);
    }
    gl.linkProgram(program);
    if (!gl.getProgramParameter(program, gl.LINK_STATUS)) throw new Error(gl.getProgramInfoLog(program));
    gl.useProgram(program);
    gl.uniformBlockBinding(program, 0, 0);
    let unit = 0;
    for (const [name, made] of Object.entries(textures)) {
      // A sampler is named after its texture and its sampler state.
      for (let i = 0; i < gl.getProgramParameter(program, gl.ACTIVE_UNIFORMS); i++) {
        const sampler = gl.getActiveUniform(program, i).name;
        if (!new RegExp(`Combined${name}(facezipLinear|SPIRV)`).test(sampler)) continue;
        gl.activeTexture(gl.TEXTURE0 + unit);
        gl.bindTexture(gl.TEXTURE_2D, made);
        gl.uniform1i(gl.getUniformLocation(program, sampler), unit++);
      }
    }
    gl.bindFramebuffer(gl.FRAMEBUFFER, gl.createFramebuffer());
    gl.framebufferTexture2D(gl.FRAMEBUFFER, gl.COLOR_ATTACHMENT0, gl.TEXTURE_2D, target, 0);
    gl.viewport(0, 0, width, height);
    gl.drawArrays(gl.TRIANGLES, 0, 3);
  };
  const sum = texture(gl.RGBA32F, gl.FLOAT, ...job.cells, null, gl.LINEAR);
  run(job.passes[0], job.cells, sum);
  textures.facezipSum = sum;
  run(job.passes[1], job.size, texture(gl.RGBA8, gl.UNSIGNED_BYTE, ...job.size, null, gl.LINEAR));
  const pixels = new Uint8Array(4 * job.size[0] * job.size[1]);
  gl.readPixels(0, 0, ...job.size, gl.RGBA, gl.UNSIGNED_BYTE, pixels);
  if (gl.getError()) throw new Error('WebGL error');
  let text = '';
  for (let i = 0; i < pixels.length; i += 32768) text += String.fromCharCode(...pixels.subarray(i, i + 32768));
  return btoa(text);
}
const browser = await chromium.launch({
  executablePath: process.env.CHROMIUM ?? '/usr/bin/chromium',
  args: ['--no-sandbox', '--disable-quic', '--no-first-run', '--disable-background-networking',
    '--disable-component-update', '--disable-sync', '--use-angle=swiftshader', '--enable-unsafe-swiftshader'],
});
let failed = false;
try {
  const page = await browser.newPage();
  writeFileSync(out, Buffer.from(await page.evaluate(draw, JSON.parse(readFileSync(file))), 'base64'));
} catch (error) {
  console.error(error.message);
  failed = true;
} finally {
  await browser.close();
}
process.exit(failed ? 1 : 0);
