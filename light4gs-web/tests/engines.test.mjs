// The examples for other engines in headless Chromium: they play, and their pictures are like the player's.
// LIGHT4GS_WEB_PICTURES names a folder for the pictures; LIGHT4GS_WEB_TIMES=1 also measures what a time costs.

import assert from "node:assert/strict";
import { existsSync, mkdirSync, mkdtempSync, readFileSync, readdirSync, rmSync, writeFileSync } from "node:fs";
import { tmpdir } from "node:os";
import { after, before, describe, test } from "node:test";
import { bundle, dist, launch, open, orbitCamera, psnr, readPng, root, sceneBytes, serve } from "./harness.mjs";

const examples = `${root}/light4gs-web/examples`;
const installed = existsSync(`${examples}/node_modules`);
const SIZE = 400;
/** The view of examples/page.js, as an OpenCV pinhole. */
const VIEW = orbitCamera({ radius: 4, elevation: 30, width: SIZE, height: SIZE, fovX: (40 * Math.PI) / 180 });
const TIMES = [0.2, 0.7];
/** How like the player's the pictures must be, in dB; docs/engines.md has what was measured, and why they differ. */
const LEAST_PSNR = { three: 45, spark: 20, babylon: 20, playcanvas: 20 };
const pictures = process.env.LIGHT4GS_WEB_PICTURES;

describe("in other engines", { skip: !installed && "npm ci in light4gs-web/examples has not been run" }, () => {
  const folder = mkdtempSync(`${tmpdir()}/light4gs-engines-`);
  let browser, server;
  /** The player's pictures at `TIMES`. */
  const references = [];

  before(async () => {
    const { buildExamples } = await import("../examples/build.mjs");
    await buildExamples(folder, `${dist}/light4gs-player.js`);
    const files = {};
    for (const entry of readdirSync(folder, { recursive: true, withFileTypes: true })) {
      if (!entry.isFile()) continue;
      const name = `${entry.parentPath}/${entry.name}`;
      files[name.slice(folder.length + 1).replace(/index\.html$/, "")] = readFileSync(name);
    }
    files.player = `<!doctype html><link rel=icon href="data:,"><canvas width=${SIZE} height=${SIZE}></canvas>`;
    files["scene.l4gs"] = sceneBytes();
    server = await serve(files);
    browser = await launch();
    if (pictures) mkdirSync(pictures, { recursive: true });

    const page = await open(browser, `${server.url}/player`);
    for (const time of TIMES) {
      const png = await page.evaluate(async ([time, view]) => {
        const { load, Player } = await import("/light4gs-player.js");
        globalThis.scene ??= await load(await (await fetch("/scene.l4gs")).arrayBuffer());
        const canvas = document.querySelector("canvas");
        globalThis.player ??= new Player(canvas, globalThis.scene, { pixelRatio: 1, controls: false });
        const pixels = await globalThis.player.renderAt(time, view);
        const picture = new OffscreenCanvas(canvas.width, canvas.height);
        picture.getContext("2d").putImageData(new ImageData(new Uint8ClampedArray(pixels), canvas.width), 0, 0);
        return Array.from(new Uint8Array(await (await picture.convertToBlob()).arrayBuffer()));
      }, [time, VIEW]);
      references.push(readPng(Buffer.from(png)));
      if (pictures) writeFileSync(`${pictures}/player-${time}.png`, Buffer.from(png));
    }
    await page.context().close();
  });

  after(async () => {
    await browser?.close();
    server?.close();
    rmSync(folder, { recursive: true, force: true });
  });

  for (const [engine, least] of Object.entries(LEAST_PSNR)) {
    test(engine, async () => {
      const page = await open(browser, `${server.url}/${engine}/`, { viewport: { width: SIZE, height: SIZE } });
      await page.waitForFunction(() => globalThis.example);
      // It plays: two times, of which none was asked for here.
      const first = await page.evaluate(() => globalThis.example.splats.time);
      await page.waitForFunction((first) => globalThis.example.splats.time !== first, first);

      const shown = [];
      for (const [index, time] of TIMES.entries()) {
        const picture = readPng(await settled(page, time));
        if (pictures) writeFileSync(`${pictures}/${engine}-${time}.png`, await page.screenshot());
        shown.push(picture);
        const distance = psnrOf(picture, references[index]);
        console.log(`  ${engine}, time ${time}: ${distance.toFixed(1)} dB`);
        assert.ok(distance >= least, `${distance} dB, expected ${least}`);
      }
      const between = psnrOf(shown[0], shown[1]);
      const reference = psnrOf(references[0], references[1]);
      console.log(`  ${engine}, the two times: ${between.toFixed(1)} dB, the player's: ${reference.toFixed(1)} dB`);
      assert.ok(Math.abs(between - reference) < 2);
      assert.deepEqual(page.problems, []);
      await page.context().close();
    });
  }
});

/** A screenshot of a time, when the picture does not change any more: some engines sort in a worker of their own. */
async function settled(page, time) {
  await page.evaluate((time) => (globalThis.example.hold = time), time);
  await page.waitForFunction((time) => globalThis.example.splats.time === time, time);
  let last = null;
  for (let i = 0; i < 40; i++) {
    await page.evaluate(() => new Promise((resolve) => setTimeout(() => requestAnimationFrame(resolve), 250)));
    const next = await page.screenshot();
    if (last?.equals(next)) return next;
    last = next;
  }
  throw new Error("the picture does not come to rest");
}

/** PSNR of two pictures of `readPng`. */
function psnrOf(picture, reference) {
  const { channels, pixels } = picture;
  const count = picture.width * picture.height;
  const rgba = new Uint8Array(4 * count);
  for (let i = 0; i < count; i++) rgba.set(pixels.subarray(channels * i, channels * i + 3), 4 * i);
  return psnr(rgba, reference);
}
