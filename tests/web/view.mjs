// Opens a GLB in three.js in headless Chromium, poses it and saves screenshots.
// node tests/web/view.mjs FILE.glb OUT_FOLDER ; exit code 1 when the page fails, a mesh lacks targets or nothing moves.
import { createReadStream, existsSync, mkdirSync } from 'node:fs';
import { createServer } from 'node:http';
import { dirname, extname, join, normalize } from 'node:path';
import { fileURLToPath } from 'node:url';
import { chromium } from 'playwright-core';

const here = dirname(fileURLToPath(import.meta.url));
const [file, out] = process.argv.slice(2);
if (!file || !out) {
  console.error('usage: node tests/web/view.mjs FILE.glb OUT_FOLDER');
  process.exit(2);
}
const poses = [
  { name: 'neutral' },
  { name: 'neutral-side', camera: 'side' },
  { name: 'smile', weights: { mouthSmileLeft: 1, mouthSmileRight: 1 } },
  { name: 'jawOpen', weights: { jawOpen: 1 } },
  { name: 'blinkLeft', camera: 'eyes', weights: { eyeBlinkLeft: 1 } },
  { name: 'eyes', camera: 'eyes' },
  { name: 'lookLeft', camera: 'eyes', weights: { eyeLookOutLeft: 1, eyeLookInRight: 1 } },
  { name: 'mouth', camera: 'mouth' },
  { name: 'jawOpen-mouth', camera: 'mouth', weights: { jawOpen: 1 } },
];

const types = { '.html': 'text/html', '.js': 'text/javascript', '.glb': 'model/gltf-binary' };
function locate(path) {
  if (path === '/rig.glb') return file;
  if (path.startsWith('/three/')) return join(here, '../../node_modules', path);
  return join(here, path);
}
const server = createServer((request, response) => {
  const path = locate(normalize(new URL(request.url, 'http://localhost').pathname));
  if (!existsSync(path)) return response.writeHead(404).end();
  response.writeHead(200, { 'content-type': types[extname(path)] ?? 'application/octet-stream' });
  createReadStream(path).pipe(response);
});
await new Promise((done) => server.listen(0, '127.0.0.1', done));

const browser = await chromium.launch({
  executablePath: process.env.CHROMIUM ?? '/usr/bin/chromium',
  args: ['--no-sandbox', '--disable-quic', '--no-first-run', '--disable-background-networking',
    '--disable-component-update', '--disable-sync', '--use-angle=swiftshader', '--enable-unsafe-swiftshader'],
});
const failures = [];
try {
  const page = await browser.newPage({ viewport: { width: 640, height: 720 } });
  page.on('pageerror', (error) => failures.push(`page: ${error.message}`));
  page.on('console', (message) => {
    const missingIcon = message.location().url.endsWith('favicon.ico');
    if (message.type() === 'error' && !missingIcon) failures.push(`console: ${message.text()}`);
  });
  await page.goto(`http://127.0.0.1:${server.address().port}/viewer.html`);
  await page.waitForFunction(() => document.title === 'ready', null, { timeout: 60000 });
  const report = await page.evaluate(() => window.rig.report());
  mkdirSync(out, { recursive: true });
  const shots = {};
  for (const { name, ...pose } of poses) {
    await page.evaluate((wanted) => window.rig.show(wanted), pose);
    shots[name] = await page.screenshot({ path: join(out, `${name}.png`) });
  }
  const targets = report.meshes.filter((mesh) => mesh.targets.length);
  for (const mesh of report.meshes) {
    console.log(`${mesh.name}: ${mesh.vertices} vertices, ${mesh.targets.length} targets` +
      `${mesh.textured ? ', textured' : ''}${mesh.normalMap ? ', normal map' : ''}`);
    if (mesh.targets.length && mesh.targets.join() !== targets[0].targets.join()) failures.push(`${mesh.name}: other targets`);
  }
  console.log(`joints: ${report.bones.join(' ')}`);
  if (!targets.length) failures.push('no mesh has targets');
  for (const [moved, rest] of [['smile', 'neutral'], ['jawOpen', 'neutral'], ['blinkLeft', 'eyes']]) {
    if (shots[moved].equals(shots[rest])) failures.push(`${moved} shows no motion`);
  }
} catch (error) {
  failures.push(error.message);
} finally {
  await browser.close();
  server.close();
}
failures.forEach((failure) => console.error(failure));
console.log(failures.length ? 'FAILED' : `screenshots in ${out}`);
process.exit(failures.length ? 1 : 0);
