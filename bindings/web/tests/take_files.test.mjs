// Files of takes in headless Chromium: where they come from, what is damaged, what grows, and what the element says of it.

import assert from "node:assert/strict";
import { test } from "node:test";
import { WHITE, makeGrowing, makeTake, partsOf, takeServer } from "./take_harness.mjs";
import { files, long, noWorkers, ranges, serveTake, take, takePage, view, wait } from "./take_page.mjs";

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
      const many = await Promise.all([0.5, 3.5, 1.5, 2.5].map(async (seconds) => (await take.gaussiansAt(seconds)).count));
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
