// Measures of a take in headless Chromium over a slow connection: the first image, seeks, images around joins, memory.

import { readFileSync } from "node:fs";
import { cpus, loadavg } from "node:os";
import { bundle, launch, open, serve } from "./harness.mjs";
import { takeServer } from "./take_harness.mjs";

/** Seconds before and after a join whose images are looked at. */
const AROUND = 0.5;
/** Milliseconds after the one before, after which an image is late. */
export const LATE = 50;

/**
 * @typedef {object} Conditions
 * @property {number} [megabits]  a second; 10
 * @property {number} [latency]  milliseconds from a request to its answer; 20
 * @property {number} [width]  of the image, pixels; 640
 * @property {number} [height]  480
 * @property {string} [cameras]  of the dataset, as JSON
 */

/** The page, of which all but the player's own is what a user writes. */
const html = ({ width = 640, height = 480 }) => `<!doctype html><link rel=icon href='data:,'>
<body style='margin:0'><script type=module src=light4gs-player.js></script>
<l4gs-player loop style='width:${width}px;height:${height + 60}px'></l4gs-player>
<script type=module>
const element = document.querySelector("l4gs-player");
/** An image that the graphics card has drawn. */
element.addEventListener("load", () => {
  element.player.renderer.finish();
  globalThis.first ??= performance.now();
});
if (!location.hash) start();
globalThis.start = start;
function start() {
  globalThis.started = performance.now();
  element.setAttribute("cameras", "cameras.json");
  element.setAttribute("src", "take.l4gs");
}
/** Notes each image: its second of the take, when it was drawn, and when the graphics card had done so. */
globalThis.note = () => {
  const { renderer, scene } = element.player;
  const images = (globalThis.images = []);
  let seconds = NaN;
  const [frame, draw, isDone] = [scene.frame.bind(scene), renderer.draw.bind(renderer), renderer.isDone.bind(renderer)];
  scene.frame = async (asked, ...others) => {
    const answer = await frame(asked, ...others);
    seconds = asked;
    return answer;
  };
  renderer.draw = (...all) => {
    draw(...all);
    images.push({ seconds, done: NaN });
  };
  renderer.isDone = (fence) => {
    const done = isDone(fence);
    const last = images[images.length - 1];
    if (done && last && Number.isNaN(last.done)) last.done = performance.now();
    return done;
  };
};
</script>`;

/**
 * Gives a page a slow connection.
 * @param {any} page @param {{ megabits: number, latency: number }} conditions
 */
export async function emulate(page, { megabits, latency }) {
  const session = await page.context().newCDPSession(page);
  await session.send("Network.enable");
  const throughput = (megabits * 1e6) / 8;
  await session.send("Network.emulateNetworkConditions", { offline: false, latency, downloadThroughput: throughput, uploadThroughput: throughput });
}

/**
 * A page of its own browser, with the take at its server.
 * @param {Buffer} bytes @param {Conditions} conditions
 * @param {(page: any, served: any, browser: any) => Promise<T>} measure
 * @param {{ hash?: string }} [options]  with a hash, the page does not load the take by itself
 * @template T
 */
async function inPage(bytes, conditions, measure, { hash = "" } = {}) {
  const { megabits = 10, latency = 20, cameras = "[]", width = 640, height = 480 } = conditions;
  const served = takeServer(bytes);
  // What a page needs to measure its memory.
  const isolated = { "cross-origin-opener-policy": "same-origin", "cross-origin-embedder-policy": "require-corp" };
  const text = html(conditions);
  const answer = (response) => response.writeHead(200, { "content-type": "text/html", ...isolated }).end(text);
  const empty = "<!doctype html><link rel=icon href='data:,'>";
  const server = await serve({ empty, "": answer, "light4gs-player.js": bundle(), "cameras.json": cameras, "take.l4gs": served.answer });
  const browser = await launch(["--enable-blink-features=ForceEagerMeasureMemory"]);
  try {
    const page = await open(browser, `${server.url}/empty`, { viewport: { width, height: height + 60 } });
    await emulate(page, { megabits, latency });
    // A browser that has only just been started is not what people have.
    await page.waitForTimeout(2000);
    await page.goto(server.url + hash);
    const measured = await measure(page, served, browser);
    if (page.problems.length > 0) throw new Error(page.problems.join("; "));
    return measured;
  } finally {
    await browser.close();
    server.close();
  }
}

const loaded = (page) => page.waitForFunction(() => globalThis.first > 0);

/**
 * The first image of a page that nobody has seen before, from the click on its link; and of a page that has the player already, from
 * the address of the take.
 * @param {Buffer} bytes @param {Conditions} conditions
 */
export async function firstImage(bytes, conditions = {}) {
  const page = await inPage(bytes, conditions, async (page, served) => {
    await loaded(page);
    return { milliseconds: await page.evaluate(() => globalThis.first), given: served.requests[0].given };
  });
  const ready = await inPage(bytes, conditions, async (page) => {
    await page.waitForTimeout(1500);
    await page.evaluate(() => globalThis.start());
    await loaded(page);
    return page.evaluate(() => globalThis.first - globalThis.started);
  }, { hash: "#later" });
  return { page: page.milliseconds, take: ready, bytes: page.given, player_bytes: bundle().length };
}

/**
 * Seeks, while the take stands still, to seconds that have not come: from setting the time to the image on the screen.
 * @param {Buffer} bytes @param {number} count @param {Conditions} conditions
 */
export async function seeks(bytes, count, conditions = {}) {
  return inPage(bytes, conditions, async (page) => {
    await loaded(page);
    await page.evaluate(() => globalThis.note());
    const found = [];
    for (let k = 0; k < count; k++) {
      // The one before has loaded what is ahead of it.
      await page.waitForTimeout(2500);
      const milliseconds = await page.evaluate(async () => {
        const { player } = document.querySelector("l4gs-player");
        const { scene } = player;
        const missing = scene.segments.places.filter(({ begin }) => !scene.loaded.some(([first]) => first === begin));
        if (missing.length === 0) return NaN;
        const { begin, end } = missing[missing.length - 1];
        const seconds = begin + 0.4 * (end - begin);
        const start = performance.now();
        player.time = seconds / scene.duration;
        for (;;) {
          const image = globalThis.images.find((image) => Math.abs(image.seconds - seconds) < 1e-3 && image.done > start);
          if (image) return image.done - start;
          await new Promise((resolve) => setTimeout(resolve, 2));
        }
      });
      if (!Number.isNaN(milliseconds)) found.push(milliseconds);
    }
    return found;
  });
}

/** Of some numbers, the one of a rank in [0, 1]: 0.5 is the middle one. @param {number[]} numbers @param {number} share */
export const rank = (numbers, share) => numbers.toSorted((a, b) => a - b)[Math.min(numbers.length - 1, Math.floor(share * numbers.length))];

/**
 * Plays over joins: milliseconds from one image to the next, each when the graphics card was done with it. Of each join, the one `across` it and the
 * `latest` within half a second.
 * @param {Buffer} bytes @param {number} count  joins @param {Conditions} conditions
 */
export async function joins(bytes, count, conditions = {}) {
  return inPage(bytes, conditions, async (page) => {
    await loaded(page);
    const { images, places, waited } = await page.evaluate(async (count) => {
      globalThis.note();
      const { player } = document.querySelector("l4gs-player");
      const { scene } = player;
      let waited = 0;
      player.addEventListener("statechange", () => (waited += Number(player.waiting)));
      const { places } = scene.segments;
      const last = places[Math.min(count, places.length - 1)].begin + 0.8;
      player.play();
      while (player.time * scene.duration < last) await new Promise((resolve) => setTimeout(resolve, 50));
      player.pause();
      return { images: globalThis.images, places: places.map(({ begin }) => begin), waited };
    }, count);
    const shown = images.filter(({ done }) => done > 0);
    const intervals = shown.slice(1).map(({ done, seconds }, k) => ({ seconds, before: shown[k].seconds, ms: done - shown[k].done }));
    // Of the first images the drafts are larger than there is time for.
    const settled = intervals.filter(({ seconds }) => seconds > 1);
    const at = places.slice(1, count + 1).map((join) => {
      const near = settled.filter(({ seconds }) => Math.abs(seconds - join) < AROUND);
      const across = settled.find(({ before, seconds }) => before < join && seconds >= join);
      return { join, across: across?.ms ?? NaN, latest: Math.max(...near.map(({ ms }) => ms)) };
    });
    const all = settled.map(({ ms }) => ms);
    const elsewhere = settled.filter(({ seconds }) => !places.some((join) => join > 0 && Math.abs(seconds - join) < AROUND)).map(({ ms }) => ms);
    return {
      joins: at, waited, images: settled.length, late: all.filter((ms) => ms > LATE).length,
      median: rank(all, 0.5), p99: rank(all, 0.99), latest: Math.max(...all), latest_elsewhere: Math.max(...elsewhere, 0),
    };
  });
}

/** Bytes of memory of the processes of one kind, which no other process has. @param {any} browser @param {string} kind */
async function processes(browser, kind) {
  const session = await browser.newBrowserCDPSession();
  const { processInfo } = await session.send("SystemInfo.getProcessInfo");
  await session.detach();
  let sum = 0;
  for (const { id, type } of processInfo) {
    if (type !== kind) continue;
    const text = readFileSync(`/proc/${id}/smaps_rollup`, "utf8");
    for (const [, kib] of text.matchAll(/^Private_(?:Clean|Dirty):\s+(\d+) kB/gm)) sum += 1024 * Number(kib);
  }
  return sum;
}

/**
 * Memory of the page while it plays, in bytes: what the page itself counts, JavaScript and decoders; and its process.
 * @param {Buffer} bytes @param {number[]} seconds  of playing after which it is looked at @param {Conditions} conditions
 */
export async function memory(bytes, seconds, conditions = {}) {
  return inPage(bytes, conditions, async (page, _, browser) => {
    await loaded(page);
    await page.evaluate(() => document.querySelector("l4gs-player").player.play());
    const start = performance.now();
    const found = [];
    const session = await page.context().newCDPSession(page);
    for (const second of seconds) {
      await page.waitForTimeout(Math.max(0, 1000 * second - (performance.now() - start)));
      await session.send("HeapProfiler.collectGarbage");
      const counted = await page.evaluate(async () => {
        const { bytes, breakdown } = await performance.measureUserAgentSpecificMemory();
        const parts = breakdown.filter(({ bytes }) => bytes > 1e5).map(({ bytes, types, attribution }) => [attribution[0]?.scope ?? "", types.join(), bytes]);
        return { bytes, parts: parts.sort(([, , a], [, , b]) => b - a) };
      });
      found.push({
        second, page: counted.bytes, parts: counted.parts, renderer: await processes(browser, "renderer"), gpu: await processes(browser, "GPU"),
      });
    }
    return found;
  });
}

/** What the machine was like. */
export const machine = () => ({ processor: cpus()[0]?.model ?? "", cores: cpus().length, load: loadavg().map((value) => Number(value.toFixed(2))) });
