// Takes in headless Chromium: what is requested, what is shown, what is kept, what is damaged, what grows.

import assert from "node:assert/strict";
import { after, before, test } from "node:test";
import { bundle, launch, open, orbitCamera, scenePath, serve } from "./harness.mjs";
import { COLORS, WHITE, makeGrowing, makeTake, partsOf, removeTakes, takeServer } from "./take_harness.mjs";

/** The shown segment, one behind, two ahead. */
const MOST_DECODED = 4;
const view = orbitCamera({ radius: 4, elevation: 60, width: 200, height: 200, fovX: 0.7 });

/** @type {Awaited<ReturnType<typeof launch>>} */
let browser;
let server;
let take, long;
const files = {
  "": "<!doctype html><link rel=icon href='data:,'><body style='margin:0'><canvas width=200 height=200></canvas>",
  "light4gs-player.js": bundle(),
  "cameras.json": JSON.stringify([{ ...view, name: "first", split: "train", time: 0 }]),
};

before(async () => {
  take = makeTake(4);
  long = makeTake(24);
  browser = await launch();
  server = await serve(files);
});

after(async () => {
  await browser?.close();
  server?.close();
  removeTakes();
});

/** Serves a take as `take.l4gs`. The stream is slow, so that what is requested does not depend on how much of it came early. */
function serveTake(bytes, options = {}) {
  const served = takeServer(bytes, { step: 64, pause: 2, ...options });
  files["take.l4gs"] = served.answer;
  return served;
}

/** What is in the page for all tests. */
async function takePage() {
  const page = await open(browser, server.url, { viewport: { width: 320, height: 400 } });
  await page.evaluate(async () => {
    globalThis.module = await import("/light4gs-player.js");
    /** The color in the middle of an image. */
    globalThis.colorOf = (pixels) => {
      const [r, g, b] = pixels.subarray(4 * (100 * 200 + 100)).map((value) => (value > 128 ? 1 : 0));
      return { "100": "red", "010": "green", "001": "blue", "110": "yellow", "011": "cyan", "101": "magenta", "111": "white", "000": "black" }[`${r}${g}${b}`];
    };
    globalThis.load = () => globalThis.module.load(new URL("/take.l4gs", location.href));
    globalThis.play = async (take, options = {}) => {
      const player = new globalThis.module.Player(document.querySelector("canvas"), take, { pixelRatio: 1, ...options });
      globalThis.player = player;
      await player.ready;
      return player;
    };
    globalThis.colorAt = async (seconds, view) => globalThis.colorOf(await globalThis.player.renderAt(seconds / globalThis.player.scene.duration, view));
    globalThis.show = async (attributes) => {
      const element = document.createElement("l4gs-player");
      Object.assign(element.style, { width: "300px", height: "340px" });
      const happened = (name) => new Promise((resolve) => element.addEventListener(name, (event) => resolve(event.detail?.kind ?? name)));
      const first = Promise.race(["load", "error"].map(happened));
      for (const [name, value] of Object.entries(attributes)) element.setAttribute(name, value);
      document.body.append(element);
      globalThis.element = element;
      return first;
    };
  });
  return page;
}

const wait = (milliseconds) => new Promise((resolve) => setTimeout(resolve, milliseconds));
/** Nothing runs on in a page. */
async function noWorkers(page) {
  for (let i = 0; i < 50 && page.workers().length > 0; i++) await wait(100);
  assert.equal(page.workers().length, 0);
}
const ranges = ({ requests }) => requests.map(({ range }) => range);

test("the first image takes front, base and first segment, and what comes next is loaded ahead", async () => {
  const served = serveTake(long, { pause: 5 });
  const { segments } = partsOf(long);
  const page = await takePage();
  const first = await page.evaluate(async (view) => {
    const take = await globalThis.load();
    await globalThis.play(take);
    return { color: await globalThis.colorAt(0, view), duration: take.duration, count: take.count, name: take.info.name };
  }, view);
  assert.deepEqual([first.color, first.duration, first.count, first.name], ["red", 25, 62, "colors"]);
  // Where the first segment is right behind the base, the first answer brings it, and ends there, but for what was on its way.
  const [stream] = served.requests;
  console.log(`  ${segments[0][1]} of ${long.length} bytes are needed for the first image; the server gave ${stream.given}`);
  assert.equal(stream.range, null);
  assert.ok(stream.given >= segments[0][1] && stream.given < long.length, `${stream.given}`);
  for (let i = 0; i < 50 && served.requests.length < 6; i++) await wait(100);
  // Five seconds ahead: one request for each segment. What the stream had brought is not requested again.
  const [second, ...others] = ranges(served).slice(1);
  assert.ok(second[0] >= segments[1][0] && second[1] === segments[1][1], second.join());
  assert.deepEqual(others, segments.slice(2, 6));
  const loaded = await page.evaluate(() => [globalThis.player.scene.loaded, globalThis.player.scene.segments.decoded.size]);
  assert.deepEqual(loaded[0].slice(0, 5), [[0, 1], [1, 2], [2, 3], [3, 4], [4, 5]]);
  assert.ok(loaded[0].length <= 6 && loaded[1] <= MOST_DECODED, JSON.stringify(loaded));
  assert.deepEqual(page.problems, []);
  await page.context().close();
});

test("a seek is one request, for the segment of that second", async () => {
  const served = serveTake(long);
  const { segments } = partsOf(long);
  const page = await takePage();
  await page.evaluate(async () => globalThis.play(await globalThis.load()));
  for (let i = 0; i < 50 && served.requests.length < 6; i++) await wait(100);
  const before = served.requests.length;
  // Each takes a while, so that what comes after the first does not hide it.
  served.delay = 300;
  const { color, milliseconds } = await page.evaluate(async (view) => {
    const start = performance.now();
    const color = await globalThis.colorAt(20.5, view);
    return { color, milliseconds: performance.now() - start };
  }, view);
  const after = ranges(served).slice(before);
  console.log(`  a seek: ${segments[20][1] - segments[20][0]} bytes, ${milliseconds.toFixed(0)} ms, of which the server waits ${served.delay}`);
  assert.equal(color, "blue");
  assert.deepEqual(after[0], segments[20]);
  assert.ok(after.length <= 2, JSON.stringify(after));
  // Back where it was: still here.
  served.delay = 0;
  await wait(500);
  const { length } = served.requests;
  assert.equal(await page.evaluate((view) => globalThis.colorAt(1.5, view), view), "green");
  assert.ok(served.requests.slice(length).every(({ range }) => range[0] > segments[2][1]), JSON.stringify(ranges(served).slice(length)));
  await page.context().close();
});

test("over a connection of 1 MB a second, the first image and a seek take the bytes of a segment", async () => {
  const large = makeTake(24, scenePath);
  const served = serveTake(large, { step: 20_000, pause: 20 });
  const { segments } = partsOf(large);
  const page = await takePage();
  const first = await page.evaluate(async () => {
    globalThis.module.prepare();
    await new Promise((resolve) => setTimeout(resolve, 1000));
    const start = performance.now();
    await globalThis.play(await globalThis.load());
    return performance.now() - start;
  });
  const [{ given }] = served.requests;
  const needed = segments[0][1];
  console.log(`  first image: ${needed} of ${large.length} bytes, 1 request that gave ${given}, ${first.toFixed(0)} ms`);
  assert.ok(given < needed + 5e5, `${given}`);
  const before = served.requests.length;
  const seek = await page.evaluate(async () => {
    const { player } = globalThis;
    const start = performance.now();
    player.time = 20.5 / player.scene.duration;
    await player.scene.ready(player.time);
    return performance.now() - start;
  });
  const asked = ranges(served).slice(before);
  console.log(`  seek: ${segments[20][1] - segments[20][0]} bytes, 1 request, ${seek.toFixed(0)} ms`);
  assert.ok(asked.some((range) => String(range) === String(segments[20])), JSON.stringify(asked));
  await page.context().close();
});

test("joins are played without a pause and without an image that lacks Gaussians", async () => {
  // Segments that take a while to decode.
  const served = serveTake(makeTake(4, scenePath), { step: Infinity });
  const page = await takePage();
  const { images, most, waited } = await page.evaluate(async (view) => {
    const take = await globalThis.load();
    const player = await globalThis.play(take, { controls: false });
    player.camera.take(view);
    player.cameraMoved();
    const images = [];
    const { renderer } = player;
    const draw = renderer.draw.bind(renderer);
    let list = 0;
    const setList = renderer.setList.bind(renderer);
    renderer.setList = (given) => ((list = given.length / 16), setList(given));
    renderer.draw = (...all) => {
      draw(...all);
      const pixels = new Uint8Array(4);
      const { width, height } = renderer.canvas;
      renderer.gl.readPixels(width >> 1, height >> 1, 1, 1, renderer.gl.RGBA, renderer.gl.UNSIGNED_BYTE, pixels);
      images.push({ at: performance.now(), seconds: take.duration * player.time, list, pixels: [...pixels] });
    };
    let most = 0;
    let waited = 0;
    take.addEventListener("progress", () => (most = Math.max(most, take.segments.decoded.size)));
    player.addEventListener("statechange", () => (waited += Number(player.waiting)));
    // Time for what comes next.
    await new Promise((resolve) => setTimeout(resolve, 1500));
    player.loop = false;
    player.play();
    while (take.duration * player.time < 3.9) await new Promise((resolve) => setTimeout(resolve, 20));
    player.pause();
    return { images, most, waited };
  }, view);
  const playing = images.filter(({ seconds }) => seconds > 0 && seconds < 3.9);
  assert.ok(playing.length > 20, `${playing.length} images`);
  // The base alone has 61 Gaussians: one row of the list.
  assert.ok(playing.every(({ list }) => list > 256), `${playing.filter(({ list }) => list <= 256).length} images without a segment`);
  const intervals = playing.slice(1).map(({ at }, k) => at - playing[k].at);
  const joins = playing.slice(1).flatMap(({ seconds }, k) => (Math.floor(seconds) > Math.floor(playing[k].seconds) ? [intervals[k]] : []));
  const median = intervals.toSorted((a, b) => a - b)[intervals.length >> 1];
  const steps = playing.slice(1).map(({ seconds }, k) => seconds - playing[k].seconds);
  console.log(`  ${playing.length} images, ${median.toFixed(0)} ms each; at joins ${joins.map((ms) => ms.toFixed(0)).join(", ")} ms`);
  assert.equal(joins.length, 3);
  assert.equal(waited, 0, "time stood still");
  assert.ok(steps.every((step) => step >= 0 && step < 0.35), `steps of ${Math.max(...steps)} s`);
  assert.ok(most <= MOST_DECODED, `${most} segments were decoded`);
  assert.ok(served.requests.length <= 4);
  assert.deepEqual(page.problems, []);
  await page.context().close();
});

test("no more than four segments are decoded, wherever the time goes", async () => {
  serveTake(long, { step: Infinity });
  const page = await takePage();
  const { most, last, colors } = await page.evaluate(async (view) => {
    const take = await globalThis.load();
    await globalThis.play(take);
    let most = 0;
    take.addEventListener("progress", () => (most = Math.max(most, take.segments.decoded.size)));
    const colors = [];
    for (const seconds of [3.5, 9.5, 21.5, 0.5, 12.5, 11.5]) colors.push(await globalThis.colorAt(seconds, view));
    await new Promise((resolve) => setTimeout(resolve, 500));
    return { most, last: [...take.segments.decoded.keys()].sort((a, b) => a - b), colors };
  }, view);
  assert.deepEqual(colors, ["yellow", "yellow", "yellow", "red", "red", "magenta"]);
  assert.ok(most <= MOST_DECODED, `${most}`);
  for (const begin of [11, 12, 13]) assert.ok(last.includes(begin), last.join());
  await page.context().close();
});

test("where no segment is, the base is shown alone", async () => {
  serveTake(take, { step: Infinity });
  const page = await takePage();
  const colors = await page.evaluate(async (view) => {
    await globalThis.play(await globalThis.load());
    const colors = [];
    for (const seconds of [0.5, 1.5, 2.5, 3.5, 4.5]) colors.push(await globalThis.colorAt(seconds, view));
    return colors;
  }, view);
  assert.deepEqual(colors, [...COLORS, WHITE]);
  await page.context().close();
});

test("a server without ranges is read as a stream, and segments are shown as they come", async () => {
  const served = serveTake(take, { ranges: false, step: 256, pause: 150 });
  const page = await takePage();
  const { early, colors, loaded } = await page.evaluate(async (view) => {
    const take = await globalThis.load();
    const early = take.loaded.length;
    await globalThis.play(take);
    const colors = [];
    for (const seconds of [0.5, 3.5, 1.5]) colors.push(await globalThis.colorAt(seconds, view));
    return { early, colors, loaded: take.loaded.length };
  }, view);
  assert.ok(early < 4, `${early} segments had come`);
  assert.deepEqual([colors, loaded], [["red", "yellow", "green"], 4]);
  assert.deepEqual(ranges(served), [null]);
  await page.context().close();
});

test("streams, buffers and files are takes too, and their Gaussians are had at a second", async () => {
  serveTake(take, { step: Infinity });
  const page = await takePage();
  const found = await page.evaluate(async () => {
    const { load, baseColors } = globalThis.module;
    const bytes = await (await fetch("/take.l4gs")).arrayBuffer();
    const all = [];
    for (const source of [bytes, new Blob([bytes]), new Uint8Array(bytes), (await fetch("/take.l4gs")).body, new URL("/take.l4gs", location.href)]) {
      const take = await load(source);
      const counts = [];
      for (const seconds of [0.5, 2.5, 4.5]) {
        const gaussians = await take.gaussiansAt(seconds);
        const last = gaussians.count - 1;
        counts.push([gaussians.count, ...baseColors(gaussians).subarray(4 * last, 4 * last + 3).map(Math.round)]);
      }
      // Many at once are answered one after the other.
      const many = await Promise.all([0.1, 3.1, 1.1, 2.1].map(async (seconds) => (await take.gaussiansAt(seconds)).count));
      all.push([counts, many]);
      take.close();
    }
    return all;
  });
  // The base has 61, of which each segment hides one and has one, 101, 201 or 301. The last of the base is gray.
  const expected = [[[61, 1, 0, 0], [261, 0, 0, 1], [61, 1, 1, 1]], [61, 361, 161, 261]];
  for (const answer of found) assert.deepEqual(answer, expected);
  await noWorkers(page);
  await page.context().close();
});

test("a damaged segment, and one that cannot be fetched, get a message, and the rest plays on", async () => {
  const { segments } = partsOf(take);
  const damaged = Buffer.from(take);
  damaged[segments[1][0] + 100] ^= 1;
  const served = serveTake(damaged, { step: Infinity });
  const [first, last] = segments[2];
  // Small pieces come with the stream in one: it ends before the segments.
  const whole = takeServer(damaged, { step: first - 100, pause: 3000 });
  files["take.l4gs"] = (response, request) => (request.headers.range ? served : whole).answer(response, request);
  served.broken = ({ range }) => range && range[1] === last;
  const page = await takePage();
  assert.equal(await page.evaluate(() => globalThis.show({ src: "/take.l4gs", cameras: "/cameras.json" })), "load");
  const status = page.locator("l4gs-player").getByRole("status");
  await status.filter({ hasText: /seconds 1 to 2: .*segment 1.*checksum/i }).waitFor();
  await status.filter({ hasText: /seconds 2 to 3/ }).waitFor();
  const { colors, error } = await page.evaluate(async (view) => {
    globalThis.player = globalThis.element.player;
    globalThis.player.pixelRatio = 1;
    const colors = [];
    const middle = async (seconds) => {
      const pixels = await globalThis.player.renderAt(seconds / globalThis.player.scene.duration, view);
      return globalThis.colorOf(pixels);
    };
    for (const seconds of [0.5, 1.5, 3.5]) colors.push(await middle(seconds));
    const error = await globalThis.player.scene.gaussiansAt(1.5).catch(({ kind, message }) => `${kind}: ${message}`);
    return { colors, error };
  }, view);
  assert.deepEqual(colors, ["red", WHITE, "yellow"]);
  assert.match(error, /^damaged: seconds 1 to 2/);
  // The connection is well again.
  served.broken = () => false;
  const color = await page.evaluate(async (view) => globalThis.colorOf(await globalThis.player.renderAt(2.5 / 5, view)), view);
  assert.ok([WHITE, "blue"].includes(color), color);
  await page.waitForFunction(async (view) => globalThis.colorOf(await globalThis.player.renderAt(2.5 / 5, view)) === "blue", view);
  await page.context().close();
});

test("a first segment that is damaged leaves the base, a message, and the rest", async () => {
  const damaged = Buffer.from(take);
  damaged[partsOf(take).segments[0][0] + 100] ^= 1;
  serveTake(damaged, { step: Infinity });
  const page = await takePage();
  assert.equal(await page.evaluate(() => globalThis.show({ src: "/take.l4gs", cameras: "/cameras.json" })), "load");
  await page.locator("l4gs-player").getByRole("status").filter({ hasText: /seconds 0 to 1/ }).waitFor();
  const colors = await page.evaluate(async (view) => {
    globalThis.player = globalThis.element.player;
    return [await globalThis.colorAt(0.5, view), await globalThis.colorAt(1.5, view)];
  }, view);
  assert.deepEqual(colors, [WHITE, "green"]);
  assert.deepEqual(page.problems, []);
  await page.context().close();
});

test("a hostile front is refused before memory is taken", async () => {
  const page = await takePage();
  const changed = (change) => {
    const bytes = Buffer.from(take);
    change(bytes);
    return bytes;
  };
  for (const [name, bytes, kind] of [
    ["slots", changed((bytes) => bytes.writeUInt32LE(0xffffffff, 16)), "too-large"],
    ["a base of 2^60 bytes", changed((bytes) => bytes.writeBigUInt64LE(1n << 60n, 28)), "too-large"],
    ["Gaussians", changed((bytes) => bytes.writeUInt32LE(0xffffffff, 36)), "too-large"],
    ["a row", changed((bytes) => (bytes[partsOf(take).base[0] - 100] ^= 1)), "damaged"],
    ["a front that is cut short", take.subarray(0, 200), "damaged"],
    ["a base that is cut short", take.subarray(0, partsOf(take).base[1] - 10), "damaged"],
    ["a newer version", changed((bytes) => bytes.writeUInt16LE(99, 8)), "newer"],
  ]) {
    const served = serveTake(bytes, { step: Infinity });
    const answer = await page.evaluate(() => globalThis.load().then(() => "a take", ({ kind }) => kind));
    assert.equal(answer, kind, name);
    assert.ok(served.requests.length <= 2, name);
  }
  assert.deepEqual(page.problems, []);
  await noWorkers(page);
  await page.context().close();
});

test("a take that grows is followed, and the time stays", async () => {
  // The last state is written anew: the index is longer, and all bytes are elsewhere.
  const states = [...makeGrowing(), makeTake(6)];
  const served = serveTake(states[0], { step: Infinity });
  let version = 1;
  files["state.json"] = (response) => response.end(JSON.stringify({ scene: version, status: "" }));
  const page = await takePage();
  await page.evaluate(() => globalThis.show({ src: "/take.l4gs", cameras: "/cameras.json", watch: "/state.json" }));
  const facts = () =>
    page.evaluate(async (view) => {
      const { player } = globalThis.element;
      globalThis.same ??= player;
      const { duration, segments } = player.scene;
      const seconds = (value) => globalThis.element.player.renderAt(value / duration, view).then(globalThis.colorOf);
      const last = segments.places.length - 0.5;
      return { same: globalThis.same === player, duration, segments: segments.places.length, color: await seconds(last), at: player.time * duration };
    }, view);
  const first = await facts();
  assert.deepEqual(first, { same: true, duration: 3, segments: 2, color: "green", at: 1.5 });
  for (let k = 1; k < states.length; k++) {
    served.bytes = states[k];
    version++;
    await page.waitForFunction((count) => globalThis.element.player.scene.segments.places.length === count, k + 2);
    const at = await page.evaluate(() => globalThis.element.player.time * globalThis.element.player.scene.duration);
    assert.ok(Math.abs(at - (k + 0.5)) < 1e-6, `${at}`);
    assert.equal((await facts()).color, ["blue", "yellow", "cyan", "magenta"][k - 1]);
  }
  // Another file in its place is loaded anew.
  served.bytes = take;
  version++;
  await page.waitForFunction(() => globalThis.element.player?.scene.segments?.places.length === 4 && globalThis.element.player !== globalThis.same);
  assert.deepEqual(page.problems, []);
  await page.context().close();
});

test("the element shows seconds and what has come, and a slow connection makes the time wait", async () => {
  const served = serveTake(long, { pause: 5 });
  served.delay = 1500;
  const page = await takePage();
  await page.evaluate(() => globalThis.show({ src: "/take.l4gs", cameras: "/cameras.json" }));
  const clock = await page.evaluate(() => globalThis.element.find("clock").value);
  assert.match(clock, /^0\.00 \/ 25\.00 s$/);
  await page.evaluate(() => {
    globalThis.waits = 0;
    globalThis.element.player.addEventListener("statechange", () => (globalThis.waits += Number(globalThis.element.player.waiting)));
    globalThis.element.player.time = 0.9 / 25;
    globalThis.element.player.play();
  });
  await page.waitForFunction(() => globalThis.element.player.time > 1.1 / 25);
  const shade = await page.evaluate(() => [globalThis.element.find("parts").style.backgroundImage, globalThis.waits]);
  assert.match(shade[0], /^linear-gradient\(to right, transparent 0.00%, var\(--accent\) 0.00% (8|12|16|20|24).00%, transparent/);
  assert.ok(shade[1] >= 1, "the time did not wait");
  await page.evaluate(() => globalThis.element.remove());
  await noWorkers(page);
  await page.context().close();
});
