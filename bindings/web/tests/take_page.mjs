// A page with the library and a server of takes, for the tests of takes in headless Chromium.

import assert from "node:assert/strict";
import { after, before } from "node:test";
import { bundle, launch, open, orbitCamera, serve } from "./harness.mjs";
import { makeTake, removeTakes, takeServer } from "./take_harness.mjs";

export const view = orbitCamera({ radius: 4, elevation: 60, width: 200, height: 200, fovX: 0.7 });

/** @type {Awaited<ReturnType<typeof launch>>} */
let browser;
let server;
/** Takes of four segments and of 24. */
export let take, long;
/** What the server has. */
export const files = {
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
export function serveTake(bytes, options = {}) {
  const served = takeServer(bytes, { step: 64, pause: 2, ...options });
  files["take.l4gs"] = served.answer;
  return served;
}

/** What is in the page for all tests. */
export async function takePage() {
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

export const wait = (milliseconds) => new Promise((resolve) => setTimeout(resolve, milliseconds));
/** Nothing runs on in a page. */
export async function noWorkers(page) {
  for (let i = 0; i < 50 && page.workers().length > 0; i++) await wait(100);
  assert.equal(page.workers().length, 0);
}
export const ranges = ({ requests }) => requests.map(({ range }) => range);
