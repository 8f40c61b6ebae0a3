// Opens KTX2 files in three.js in headless Chromium and with ktx-parse, an independent reader.
// node tests/web/ktx2.mjs OUT_FOLDER FILE.ktx2 ...
// Writes FILE.json (what both say) and FILE.rgba (level 0 as three.js draws it); exit code 1 when one does not open.
import { createReadStream, existsSync, mkdirSync, readFileSync, writeFileSync } from 'node:fs';
import { createServer } from 'node:http';
import { basename, dirname, extname, join, normalize } from 'node:path';
import { fileURLToPath } from 'node:url';
import { chromium } from 'playwright-core';
import { read } from '../../node_modules/three/examples/jsm/libs/ktx-parse.module.js';

const here = dirname(fileURLToPath(import.meta.url));
const [out, ...files] = process.argv.slice(2);
if (!files.length) {
  console.error('usage: node tests/web/ktx2.mjs OUT_FOLDER FILE.ktx2 ...');
  process.exit(2);
}
mkdirSync(out, { recursive: true });
const types = { '.html': 'text/html', '.js': 'text/javascript', '.wasm': 'application/wasm' };
const server = createServer((request, response) => {
  const path = normalize(new URL(request.url, 'http://localhost').pathname);
  const number = /^\/file\/(\d+)$/.exec(path);
  const local = number ? files[Number(number[1])] : path.startsWith('/three/') ? join(here, '../../node_modules', path) : join(here, path);
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
  await page.goto(`http://127.0.0.1:${server.address().port}/ktx2.html`);
  await page.waitForFunction(() => document.title === 'ready', null, { timeout: 60000 });
  for (const [i, file] of files.entries()) {
    const { pixels, ...three } = await page.evaluate((url) => window.open2(url), `/file/${i}`);
    const container = read(new Uint8Array(readFileSync(file)));
    const parsed = { vkFormat: container.vkFormat, width: container.pixelWidth, height: container.pixelHeight,
      levels: container.levels.map((level) => level.levelData.byteLength), keys: container.keyValue };
    writeFileSync(join(out, `${basename(file)}.json`), JSON.stringify({ three, parsed }));
    writeFileSync(join(out, `${basename(file)}.rgba`), Buffer.from(pixels, 'base64'));
    if (three.error) failures.push(`${file}: WebGL error ${three.error}`);
  }
} catch (error) {
  failures.push(error.message);
} finally {
  await browser.close();
  server.close();
}
failures.forEach((failure) => console.error(failure));
process.exit(failures.length ? 1 : 0);
