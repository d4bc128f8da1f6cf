// Takes in headless Chromium: what is requested, what is shown, what is kept.

import assert from "node:assert/strict";
import { test } from "node:test";
import { scenePath } from "./harness.mjs";
import { COLORS, WHITE, makeTake, partsOf } from "./take_harness.mjs";
import { files, long, ranges, serveTake, take, takePage, view, wait } from "./take_page.mjs";

/** The shown segment, one behind, two ahead. */
const MOST_DECODED = 4;

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
    renderer.setList = (given, later) => {
      list = (given.length + (later?.list.length ?? 0)) / 16;
      setList(given, later);
    };
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

test("in a fade, the picture is the mean of those with either segment", async () => {
  serveTake(take, { step: Infinity });
  const page = await takePage();
  const { weight, differences, apart, kinds } = await page.evaluate(async (view) => {
    const player = await globalThis.play(await globalThis.load(), { controls: false });
    const { renderer } = player;
    let both;
    const setList = renderer.setList.bind(renderer);
    renderer.setList = (...given) => {
      both = given.map((one) => (one.list ? { ...one, list: one.list.slice() } : one.slice()));
      setList(...given);
    };
    // The second segment goes over into the third: both must be there.
    player.time = 1.5 / player.scene.duration;
    while (player.scene.segments.decoded.size < 3) await new Promise((resolve) => setTimeout(resolve, 20));
    const drawn = await player.renderAt(1.98 / player.scene.duration, view);
    const [earlier, later] = both;
    const pictures = [earlier, later.list].map((list) => {
      setList(list);
      renderer.draw(view, player.background);
      return renderer.readPixels();
    });
    const mean = drawn.map((_, k) => Math.round((1 - later.weight) * pictures[0][k] + later.weight * pictures[1][k]));
    // One list for both is a draft; elsewhere there is one segment.
    const from = { row: [0, 0, 1, 4], eye: [0, 0, -4] };
    const kinds = [];
    for (const [seconds, apart] of [[1.98, true], [1.98, false], [1.5, true]]) {
      const { later, together } = await player.scene.frame(seconds, from, null, 0, apart);
      kinds.push([later !== null, together]);
    }
    const differ = (/** @type {Uint8Array} */ one) => one.reduce((most, value, k) => Math.max(most, Math.abs(value - drawn[k])), 0);
    return { weight: later.weight, differences: differ(mean), apart: pictures.map(differ), kinds };
  }, view);
  assert.ok(weight > 0.1 && weight < 0.9, `${weight}`);
  assert.deepEqual(kinds, [[true, false], [false, true], [false, false]]);
  assert.ok(apart.every((difference) => difference > 20), apart.join());
  // The canvas rounds twice.
  assert.ok(differences <= 2, `${differences}`);
  assert.deepEqual(page.problems, []);
  await page.context().close();
});

test("at rest in a fade, the image is drawn again when the other segment comes", async () => {
  serveTake(take);
  const [first] = partsOf(take).segments[2];
  let release;
  const released = new Promise((resolve) => (release = resolve));
  const answer = files["take.l4gs"];
  files["take.l4gs"] = async (response, request) => {
    if (request.headers.range?.startsWith(`bytes=${first}-`)) await released;
    return answer(response, request);
  };
  const page = await takePage();
  await page.evaluate(async (view) => {
    const player = await globalThis.play(await globalThis.load(), { controls: false });
    player.camera.take(view);
    player.cameraMoved();
    const setList = player.renderer.setList.bind(player.renderer);
    player.renderer.setList = (given, later) => {
      globalThis.list = (given.length + (later?.list.length ?? 0)) / 16;
      setList(given, later);
    };
    globalThis.list = 0;
    // The second segment goes over into the third.
    player.time = 1.98 / player.scene.duration;
  }, view);
  const shown = () => page.evaluate(() => [globalThis.list, [...globalThis.player.scene.segments.decoded.keys()]]);
  for (let i = 0; i < 50 && (await shown())[1].length < 2; i++) await wait(100);
  await wait(500);
  // Base and second segment have 161 Gaussians: one row of the list.
  assert.deepEqual(await shown(), [256, [0, 1]]);
  release();
  // Two lists: base and third segment take two rows.
  for (let i = 0; i < 50 && (await shown())[0] < 768; i++) await wait(100);
  assert.equal((await shown())[0], 768);
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

test("an image waits again where its segment was forgotten meanwhile", async () => {
  serveTake(long, { step: Infinity });
  const page = await takePage();
  const colors = await page.evaluate(async (view) => {
    const take = await globalThis.load();
    await globalThis.play(take);
    const colors = [await globalThis.colorAt(21.5, view)];
    const { ready } = take;
    take.ready = async (share) => {
      take.ready = ready;
      await take.ready(share);
      take.segments.decoded.delete(0);
    };
    colors.push(await globalThis.colorAt(0.5, view));
    return colors;
  }, view);
  assert.deepEqual(colors, ["yellow", "red"]);
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

