// Renders blends in a preview.html of FaceZip in headless Chromium, straight from the file and without a network.
// node tests/web/facezip.mjs PREVIEW.html BLENDS.json OUT_FOLDER
// BLENDS.json holds lists of weights. Writes blend<i>.float, .half (compressed), .original (RGBA bytes, row 0 on top)
// and page.png; exit code 1 when the page fails or asks for anything beyond itself.
import { mkdirSync, readFileSync, writeFileSync } from 'node:fs';
import { join, resolve } from 'node:path';
import { pathToFileURL } from 'node:url';
import { chromium } from 'playwright-core';

const [file, blends, out] = process.argv.slice(2);
if (!out) {
  console.error('usage: node tests/web/facezip.mjs PREVIEW.html BLENDS.json OUT_FOLDER');
  process.exit(2);
}
mkdirSync(out, { recursive: true });
const browser = await chromium.launch({
  executablePath: process.env.CHROMIUM ?? '/usr/bin/chromium',
  args: ['--no-sandbox', '--disable-quic', '--no-first-run', '--disable-background-networking',
    '--disable-component-update', '--disable-sync', '--use-angle=swiftshader', '--enable-unsafe-swiftshader'],
});
const failures = [];
try {
  const context = await browser.newContext({ viewport: { width: 1500, height: 700 }, offline: true });
  const page = await context.newPage();
  page.on('pageerror', (error) => failures.push(`page: ${error.message}`));
  page.on('console', (message) => { if (message.type() === 'error') failures.push(`console: ${message.text()}`); });
  page.on('request', (request) => {
    if (!/^(data|blob):/.test(request.url()) && request.url() !== pathToFileURL(resolve(file)).href) failures.push(`asks for ${request.url()}`);
  });
  await page.goto(pathToFileURL(resolve(file)).href);
  await page.waitForFunction(() => document.body.dataset.ready === 'yes' || document.getElementById('error').textContent, null, { timeout: 120000 });
  const render = (weights, options) => page.evaluate(([w, o]) => {
    const pixels = window.facezip.render(w, o);
    let text = '';
    for (let i = 0; i < pixels.length; i += 32768) text += String.fromCharCode(...pixels.subarray(i, i + 32768));
    return btoa(text);
  }, [weights, options]).then((text) => Buffer.from(text, 'base64'));
  for (const [i, weights] of JSON.parse(readFileSync(blends)).entries()) {
    writeFileSync(join(out, `blend${i}.float`), await render(weights, {}));
    writeFileSync(join(out, `blend${i}.half`), await render(weights, { inHalf: true }));
    writeFileSync(join(out, `blend${i}.original`), await render(weights, { mode: 0 }));
  }
  await page.screenshot({ path: join(out, 'page.png') });
} catch (error) {
  failures.push(error.message);
} finally {
  await browser.close();
}
failures.forEach((failure) => console.error(failure));
process.exit(failures.length ? 1 : 0);
