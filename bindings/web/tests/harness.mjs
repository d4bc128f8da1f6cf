// Code that the browser tests share: a server for the bundle and the scenes, Chromium, cameras, distances between
// images.

import { createServer } from "node:http";
import { existsSync, readFileSync } from "node:fs";
import { fileURLToPath } from "node:url";
import { inflateSync } from "node:zlib";
import { chromium } from "playwright-core";

export const root = fileURLToPath(new URL("../../..", import.meta.url));
export const dist = process.env.LIGHT4GS_WEB_DIST ?? `${root}/bindings/web/dist`;
export const scenePath = process.env.LIGHT4GS_WEB_SCENE ?? `${root}/bindings/web/tests/data/quickstart.l4gs`;

const TYPES = { js: "text/javascript", html: "text/html", l4gs: "application/octet-stream", json: "application/json" };

/** Serves a table of paths to bytes, or to functions that answer by themselves; `""` is an empty page. */
export async function serve(files) {
  const server = createServer((request, response) => {
    const name = decodeURIComponent(new URL(request.url, "http://localhost").pathname.slice(1));
    const content = files[name];
    if (content === undefined) return response.writeHead(404).end("not found");
    if (typeof content === "function") return content(response, request);
    response.writeHead(200, { "content-type": TYPES[name.split(".").pop()] ?? "text/html", "content-length": Buffer.byteLength(content) });
    response.end(content);
  });
  await new Promise((resolve) => server.listen(0, "127.0.0.1", resolve));
  return { url: `http://127.0.0.1:${server.address().port}`, close: () => server.close() };
}

export const bundle = () => readFileSync(`${dist}/light4gs-player.js`);
export const sceneBytes = () => readFileSync(scenePath);

/** Chromium without a window, drawing in software; with more flags. */
export async function launch(flags = []) {
  const executablePath = ["/usr/bin/chromium", "/usr/bin/chromium-browser", "/usr/bin/google-chrome"].find(existsSync);
  if (!executablePath) throw new Error("there is no Chromium; on Debian: apt-get install chromium");
  return chromium.launch({
    executablePath,
    args: [
      "--no-sandbox", "--disable-quic", "--no-first-run", "--disable-background-networking",
      "--disable-component-update", "--disable-sync", "--use-gl=angle", "--use-angle=swiftshader",
      "--enable-unsafe-swiftshader", "--js-flags=--expose-gc", "--enable-precise-memory-info", ...flags,
    ],
  });
}

/** A page that notes what goes wrong on it: `page.problems`. */
export async function open(browser, url, options = {}) {
  const context = await browser.newContext({ viewport: { width: 1000, height: 900 }, ...options });
  // A machine may have other work.
  context.setDefaultTimeout(120_000);
  const page = await context.newPage();
  page.problems = [];
  page.on("pageerror", (error) => page.problems.push(String(error)));
  page.on("console", (message) => {
    if (message.type() === "error") page.problems.push(message.text());
  });
  await page.goto(url);
  return page;
}

/** The camera of `light4gs render --path fixed`, an OpenCV pinhole. */
export function orbitCamera({ radius, elevation, width, height, fovX }) {
  const e = (elevation * Math.PI) / 180;
  const eye = [0, -radius * Math.cos(e), radius * Math.sin(e)];
  const forward = eye.map((x) => -x / radius);
  const cross = (a, b) => [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];
  const unit = (a) => a.map((x) => x / Math.hypot(...a));
  const right = unit(cross(forward, [0, 0, 1]));
  const down = cross(forward, right);
  const focal = width / 2 / Math.tan(fovX / 2);
  const translation = [right, down, forward].map((axis) => -axis.reduce((sum, x, i) => sum + x * eye[i], 0));
  return { rotation: [...right, ...down, ...forward], translation, fx: focal, fy: focal, cx: width / 2, cy: height / 2, width, height };
}

/** A PNG of bytes without interlacing, as `light4gs render` writes it: `{ width, height, channels, pixels }`. */
export function readPng(bytes) {
  const parts = [];
  let header;
  for (let at = 8; at < bytes.length; ) {
    const length = bytes.readUInt32BE(at);
    const type = bytes.toString("latin1", at + 4, at + 8);
    const data = bytes.subarray(at + 8, at + 8 + length);
    if (type === "IHDR") header = { width: data.readUInt32BE(0), height: data.readUInt32BE(4), channels: { 2: 3, 6: 4 }[data[9]] };
    if (type === "IDAT") parts.push(data);
    at += 12 + length;
  }
  const { width, height, channels } = header;
  const raw = inflateSync(Buffer.concat(parts));
  const row = width * channels;
  const pixels = new Uint8Array(row * height);
  for (let y = 0; y < height; y++) {
    const filter = raw[y * (row + 1)];
    for (let x = 0; x < row; x++) {
      const left = x >= channels ? pixels[y * row + x - channels] : 0;
      const above = y > 0 ? pixels[(y - 1) * row + x] : 0;
      const corner = y > 0 && x >= channels ? pixels[(y - 1) * row + x - channels] : 0;
      const distances = [left, above, corner].map((value) => Math.abs(left + above - corner - value));
      const nearest = distances[0] <= distances[1] && distances[0] <= distances[2] ? left : distances[1] <= distances[2] ? above : corner;
      const predicted = [0, left, above, (left + above) >> 1, nearest][filter];
      pixels[y * row + x] = raw[y * (row + 1) + 1 + x] + predicted;
    }
  }
  return { width, height, channels, pixels };
}

/** PSNR in dB over red, green and blue of an image `[H, W, 4]` against one of `[H, W, channels]`. */
export function psnr(pixels, reference) {
  const { channels } = reference;
  let sum = 0;
  const count = reference.width * reference.height;
  for (let i = 0; i < count; i++) {
    for (let c = 0; c < 3; c++) sum += (pixels[4 * i + c] - reference.pixels[channels * i + c]) ** 2;
  }
  return 10 * Math.log10(255 ** 2 / (sum / (3 * count)));
}
