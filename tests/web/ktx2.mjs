// Opens KTX2 files of a packed set in three.js in headless Chromium and with ktx-parse, an independent reader, and
// draws a blend with the recipe of docs/compress-engines.md.
// node tests/web/ktx2.mjs OUT_FOLDER PACKED_FOLDER WEIGHTS FILE.ktx2 ...
// WEIGHTS is JSON, {"smile": 0.5}. Writes FILE.json (what both say), FILE.rgba (level 0 as three.js draws it) and
// blend.png; exit code 1 when one does not open.
import { createReadStream, existsSync, mkdirSync, readFileSync, writeFileSync } from 'node:fs';
import { createServer } from 'node:http';
import { basename, dirname, extname, join, normalize } from 'node:path';
import { fileURLToPath } from 'node:url';
import { chromium } from 'playwright-core';
import { read } from '../../node_modules/three/examples/jsm/libs/ktx-parse.module.js';

const here = dirname(fileURLToPath(import.meta.url));
const [out, packed, weights, ...files] = process.argv.slice(2);
if (!files.length) {
  console.error('usage: node tests/web/ktx2.mjs OUT_FOLDER PACKED_FOLDER WEIGHTS FILE.ktx2 ...');
  process.exit(2);
}
mkdirSync(out, { recursive: true });
const types = { '.html': 'text/html', '.js': 'text/javascript', '.wasm': 'application/wasm', '.json': 'application/json' };
function locate(path) {
  const number = /^\/file\/(\d+)$/.exec(path);
  if (number) return files[Number(number[1])];
  if (path.startsWith('/packed/')) return join(packed, path.slice(8));
  return path.startsWith('/three/') ? join(here, '../../node_modules', path) : join(here, path);
}
const server = createServer((request, response) => {
  const path = normalize(new URL(request.url, 'http://localhost').pathname);
  const local = locate(path);
  if (!existsSync(local)) return response.writeHead(404).end();
  response.writeHead(200, { 'content-type': types[extname(local)] ?? 'application/octet-stream' });
  createReadStream(local).pipe(response);
});
await new Promise((done) => server.listen(0, '127.0.0.1', done));
const browser = await chromium.launch({
  executablePath: process.env.CHROMIUM ?? '/usr/bin/chromium',
  args: ['--no-sandbox', '--disable-quic', '--no-first-run', '--disable-background-networking',
    '--disable-component-update', '--disable-sync', '--use-angle=swiftshader', '--enable-unsafe-swiftshader'],
});
const failures = [];
try {
  const page = await browser.newPage();
  page.on('pageerror', (error) => failures.push(`page: ${error.message}`));
  page.on('console', (message) => {
    const missingIcon = message.location().url.endsWith('favicon.ico');
    if (['error', 'warning'].includes(message.type()) && !missingIcon && !/GPU stall/.test(message.text())) failures.push(`console: ${message.text()}`);
  });
  const open = async (name) => {
    await page.goto(`http://127.0.0.1:${server.address().port}/${name}`);
    await page.waitForFunction(() => document.title === 'ready', null, { timeout: 60000 });
  };
  await open('ktx2.html');
  for (const [i, file] of files.entries()) {
    const { pixels, ...three } = await page.evaluate((url) => window.open2(url), `/file/${i}`);
    const container = read(new Uint8Array(readFileSync(file)));
    const parsed = { vkFormat: container.vkFormat, width: container.pixelWidth, height: container.pixelHeight,
      levels: container.levels.map((level) => level.levelData.byteLength), keys: container.keyValue };
    writeFileSync(join(out, `${basename(file)}.json`), JSON.stringify({ three, parsed }));
    writeFileSync(join(out, `${basename(file)}.rgba`), Buffer.from(pixels, 'base64'));
    if (three.error) failures.push(`${file}: WebGL error ${three.error}`);
  }
  await open('engine.html');
  const url = await page.evaluate((w) => window.show(w), JSON.parse(weights));
  writeFileSync(join(out, 'blend.png'), Buffer.from(url.split(',')[1], 'base64'));
} catch (error) {
  failures.push(error.message);
} finally {
  await browser.close();
  server.close();
}
failures.forEach((failure) => console.error(failure));
process.exit(failures.length ? 1 : 0);
