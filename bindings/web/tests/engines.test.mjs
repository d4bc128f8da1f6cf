// The examples for other engines in headless Chromium: they play, and their pictures are like the player's.
// LIGHT4GS_WEB_PICTURES names a folder for the pictures; LIGHT4GS_WEB_TIMES=1 also measures the cost of a new time. The
// bounds are those of the scene of the quickstart: with LIGHT4GS_WEB_SCENE they are not checked.

import assert from "node:assert/strict";
import { existsSync, mkdirSync, mkdtempSync, readFileSync, readdirSync, rmSync, writeFileSync } from "node:fs";
import { tmpdir } from "node:os";
import { after, before, describe, test } from "node:test";
import { bundle, dist, launch, open, orbitCamera, psnr, readPng, root, sceneBytes, serve } from "./harness.mjs";
import { makeTake, removeTakes } from "./take_harness.mjs";

const examples = `${root}/bindings/web/examples`;
const installed = existsSync(`${examples}/node_modules`);
const SIZE = 400;
/** The view of examples/page.js, as an OpenCV pinhole. */
const VIEW = orbitCamera({ radius: 4, elevation: 30, width: SIZE, height: SIZE, fovX: (40 * Math.PI) / 180 });
const TIMES = [0.2, 0.7];
/** How like the player's the pictures must be, in dB: two or more below what was measured. docs/engines.md says why they differ. */
const LEAST_PSNR = { three: 50, spark: 34.5, babylon: 37.5, playcanvas: 31 };
const pictures = process.env.LIGHT4GS_WEB_PICTURES;

describe("in other engines", { skip: !installed && "npm ci in bindings/web/examples has not been run" }, () => {
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
    files["take.l4gs"] = makeTake(4);
    Object.assign(files, wholePage());
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
      const reference = readRgba(Buffer.from(png));
      references.push(reference);
      if (pictures) writeFileSync(`${pictures}/player-${time}.png`, reference.png);
    }
    await page.context().close();
  });

  after(async () => {
    await browser?.close();
    server?.close();
    removeTakes();
    rmSync(folder, { recursive: true, force: true });
  });

  const examplePage = async (engine) => {
    const page = await open(browser, `${server.url}/${engine.includes("?") ? engine : `${engine}/`}`, { viewport: { width: SIZE, height: SIZE } });
    await page.waitForFunction(() => globalThis.example);
    return page;
  };

  for (const [engine, least] of Object.entries(LEAST_PSNR)) {
    test(engine, async () => {
      const page = await examplePage(engine);
      // It plays: two times, neither of which was asked for here.
      const first = await page.evaluate(() => globalThis.example.splats.time);
      await page.waitForFunction((first) => globalThis.example.splats.time !== first, first);
      if (process.env.LIGHT4GS_WEB_TIMES) return measure(page, engine);

      const shown = [];
      for (const [index, time] of TIMES.entries()) {
        const picture = await settled(page, time);
        if (pictures) writeFileSync(`${pictures}/${engine}-${time}.png`, picture.png);
        shown.push(picture);
        const distance = psnr(picture.pixels, references[index]);
        console.log(`  ${engine}, time ${time}: ${distance.toFixed(1)} dB`);
        if (!process.env.LIGHT4GS_WEB_SCENE) assert.ok(distance >= least, `${distance} dB, expected ${least}`);
      }
      // Objects have moved as far as in the player.
      const between = psnr(shown[0].pixels, shown[1]);
      const expected = psnr(references[0].pixels, references[1]);
      console.log(`  ${engine}, one time against the other: ${between.toFixed(1)} dB, the player's: ${expected.toFixed(1)} dB`);
      assert.ok(Math.abs(between - expected) < 1);

      await page.evaluate(() => globalThis.example.splats.dispose());
      const { pixels } = await still(page);
      assert.ok(pixels.every((value) => value === 255), "something is left of it");
      assert.deepEqual(page.problems, []);
      await page.context().close();
    });
  }

  test("a take is drawn in all of them, with another number of Gaussians in each segment", async () => {
    for (const engine of Object.keys(LEAST_PSNR)) {
      const page = await examplePage(`${engine}/?scene=/take.l4gs`);
      const colors = [];
      for (const seconds of [0.5, 2.5, 4.5, 1.5]) {
        const { pixels } = await settled(page, seconds);
        colors.push(Array.from(pixels.subarray(4 * (SIZE * 200 + 200), 4 * (SIZE * 200 + 200) + 3)).map((value) => Number(value > 128)).join(""));
      }
      // Red, blue, none, green.
      assert.deepEqual(colors, ["100", "001", "111", "010"], engine);
      assert.deepEqual(page.problems, []);
      await page.context().close();
    }
  });

  test("the page about the library has a running scene", async () => {
    const page = await open(browser, `${server.url}/`);
    await page.waitForFunction(() => document.querySelector("l4gs-player").player?.time > 0);
    const first = await page.evaluate(() => document.querySelector("l4gs-player").player.time);
    await page.waitForFunction((first) => document.querySelector("l4gs-player").player.time !== first, first);
    const [player, picture] = [await page.locator("l4gs-player").boundingBox(), await page.locator("l4gs-player canvas").boundingBox()];
    assert.ok(picture.width > 0.9 * player.width && picture.height > 0.6 * player.height, JSON.stringify(picture));
    if (pictures) writeFileSync(`${pictures}/page.png`, await page.screenshot());
    await page.getByText("Babylon.js", { exact: true }).click();
    await page.frameLocator('iframe[src="babylon/"]').locator("canvas").waitFor();
    await page.frames().find((frame) => frame.url().endsWith("/babylon/")).waitForFunction(() => globalThis.example?.splats.time > 0);
    assert.deepEqual(page.problems, []);
    await page.context().close();
  });

  test("the whole page of docs/engines.md plays", async () => {
    const page = await open(browser, `${server.url}/whole-page`, { viewport: { width: SIZE, height: SIZE } });
    await page.locator("canvas").waitFor();
    /** Red, green and blue of the first picture that passes, within a minute. */
    const picture = async (passes) => {
      for (const end = Date.now() + 60_000; Date.now() < end; ) {
        const { pixels } = readRgba(await page.screenshot());
        if (passes(pixels)) return pixels;
      }
      throw new Error("nothing is drawn, or nothing moves");
    };
    // The background is black.
    const first = await picture((pixels) => pixels.filter((value, i) => i % 4 < 3 && value > 64).length > 0.05 * pixels.length);
    await picture((pixels) => !Buffer.from(pixels).equals(Buffer.from(first)));
    assert.deepEqual(page.problems, []);
    await page.context().close();
  });

  test("three: the mesh goes where its matrix says", async () => {
    const page = await examplePage("three");
    await page.evaluate(() => {
      const { THREE, splats, camera } = globalThis.example;
      // Mesh and camera, moved alike: the same picture.
      const turn = new THREE.Quaternion().setFromEuler(new THREE.Euler(0.3, -1.1, 0.7));
      const place = new THREE.Vector3(5, -2, 1);
      splats.object.position.copy(place);
      splats.object.quaternion.copy(turn);
      splats.object.scale.setScalar(2);
      camera.position.multiplyScalar(2).applyQuaternion(turn).add(place);
      camera.quaternion.premultiply(turn);
    });
    const distance = psnr((await settled(page, TIMES[0])).pixels, references[0]);
    console.log(`  three, moved, turned and twice as large: ${distance.toFixed(1)} dB`);
    assert.ok(distance >= LEAST_PSNR.three, `${distance} dB`);
    assert.deepEqual(page.problems, []);
    await page.context().close();
  });

  test("three: opaque objects hide what is behind them, and nothing else", async () => {
    const page = await examplePage("three");
    await page.evaluate(() => {
      const { THREE, world, camera } = globalThis.example;
      // A red wall through the middle of the scene, across the view.
      const wall = new THREE.Mesh(new THREE.PlaneGeometry(9, 9), new THREE.MeshBasicMaterial({ color: 0xff0000 }));
      wall.quaternion.copy(camera.quaternion);
      world.add(wall);
    });
    const { pixels, png } = await settled(page, TIMES[0]);
    if (pictures) writeFileSync(`${pictures}/three-wall.png`, png);
    const at = ([x, y]) => Array.from(pixels.subarray(4 * (SIZE * y + x), 4 * (SIZE * y + x) + 3));
    const expected = ([x, y]) => Array.from(references[0].pixels.subarray(4 * (SIZE * y + x), 4 * (SIZE * y + x) + 3));
    // The ring and the far side of the floor are hidden; the ball, in front of the wall, is as it was.
    for (const behind of [[155, 115], [285, 215]]) assert.deepEqual(at(behind), [255, 0, 0]);
    const ball = [155, 272];
    assert.ok(Math.hypot(...at(ball).map((value, i) => value - expected(ball)[i])) < 25, `${at(ball)}, expected ${expected(ball)}`);

    // If the target wants linear colors, such as for later effects, it gets them.
    await page.evaluate(() => (globalThis.example.renderer.outputColorSpace = globalThis.example.THREE.LinearSRGBColorSpace));
    const linear = Array.from((await still(page)).pixels.subarray(4 * (SIZE * ball[1] + ball[0]))).slice(0, 3);
    const converted = expected(ball).map((value) => 255 * (value <= 10.3 ? value / 255 / 12.92 : ((value / 255 + 0.055) / 1.055) ** 2.4));
    assert.ok(Math.hypot(...linear.map((value, i) => value - converted[i])) < 25, `${linear}, expected ${converted}`);
    assert.deepEqual(page.problems, []);
    await page.context().close();
  });
});

/** The page of docs/engines.md and the modules of its import map, where npm puts them. */
function wholePage() {
  const text = readFileSync(`${root}/docs/engines.md`, "utf8");
  const html = /## A whole page\n.*?```html\n(.*?)```/s.exec(text)?.[1];
  const { imports } = JSON.parse(/<script type="importmap">(.*?)<\/script>/s.exec(html)[1]);
  const files = { "whole-page": html, "favicon.ico": "" };
  for (const address of [...Object.values(imports), "./node_modules/three/build/three.core.js"]) {
    const name = address.slice("./".length);
    const ours = name.replace(/^node_modules\/light4gs-player\/(dist\/)?/, (_, built) => (built ? `${dist}/` : `${root}/bindings/web/`));
    files[name] = readFileSync(ours === name ? `${examples}/${name}` : ours);
  }
  return files;
}

/** The picture of a page, when it does not change any more: some engines sort in a worker of their own. */
async function still(page) {
  let last = null;
  for (let i = 0; i < 40; i++) {
    await page.evaluate(() => new Promise((resolve) => setTimeout(() => requestAnimationFrame(resolve), 250)));
    const png = await page.screenshot();
    if (last?.equals(png)) return readRgba(png);
    last = png;
  }
  throw new Error("the picture does not come to rest");
}

/** The picture of a time. */
async function settled(page, time) {
  await page.evaluate((time) => (globalThis.example.hold = time), time);
  await page.waitForFunction((time) => globalThis.example.splats.time === time, time);
  return still(page);
}

/** A PNG as `[H, W, 4]` bytes. */
function readRgba(png) {
  const { width, height, channels, pixels } = readPng(png);
  const rgba = new Uint8Array(4 * width * height).fill(255);
  for (let i = 0; i < width * height; i++) rgba.set(pixels.subarray(channels * i, channels * i + 3), 4 * i);
  return { width, height, channels: 4, pixels: rgba, png };
}

/** What a time costs the page's own thread: without the worker, which has answered already, and without what is drawn. */
async function measure(page, engine) {
  await page.setViewportSize({ width: 16, height: 16 });
  const found = await page.evaluate(async () => {
    const { scene, create } = globalThis.example;
    const [gaussians, { list }] = [await scene.gaussiansAt(0.5), await scene.frame(0.5, { row: [0, 1, 0, 4], eye: [0, -4, 2] })];
    const repeated = (array, times) => {
      const all = new Float32Array(times * array.length);
      for (let i = 0; i < times; i++) all.set(array, i * array.length);
      return all;
    };
    const lines = [];
    for (const [times, shDegree] of [[1], [16], [16, 0]]) {
      const count = times * scene.count;
      const arrays = Object.entries(gaussians).filter(([, array]) => array instanceof Float32Array);
      const answer = { count, shDegree: gaussians.shDegree, ...Object.fromEntries(arrays.map(([name, array]) => [name, repeated(array, times)])) };
      const frame = { list: repeated(list, times) };
      const stored = { count, info: { ...scene.info, count }, gaussiansAt: async () => answer, frame: async () => frame };
      const splats = await create(stored, shDegree);
      let least = Infinity;
      for (let i = 1; i <= 30; i++) {
        const start = performance.now();
        await splats.update(i / 30);
        least = Math.min(least, performance.now() - start);
        await new Promise((resolve) => setTimeout(resolve, 20));
      }
      splats.dispose();
      lines.push(`${count} Gaussians${shDegree === 0 ? ", colors of degree 0 only" : ""}: ${least.toFixed(1)} ms`);
    }
    return lines;
  });
  for (const line of found) console.log(`  ${engine}, what a time costs, least of 30: ${line}`);
}
