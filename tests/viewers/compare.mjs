// Opens a file's first moment as PLY and as GLB in PlayCanvas (headless Chromium, software WebGL2), from the cameras of
// `light4gs render --path frozen`, and compares the pictures with ours.
//
// usage: node compare.mjs PROGRAM FILE.l4gs [FOLDER]     the pictures stay in FOLDER

import { execFileSync } from "node:child_process";
import fs from "node:fs";
import http from "node:http";
import os from "node:os";
import path from "node:path";
import { fileURLToPath } from "node:url";

import { PNG } from "pngjs";
import puppeteer from "puppeteer-core";

const VIEWS = 4;
const SIZE = 400;
// As `light4gs render` has them: distance, and height in degrees.
const ORBIT = [4, 30];
// PlayCanvas has coarser splats (no 1/255 cutoff, half floats), so pictures are alike and not equal.
const LEAST_PSNR = 28;
const CHROMIUM = process.env.CHROMIUM ?? "/usr/bin/chromium";

const here = path.dirname(fileURLToPath(import.meta.url));
const [program, file, folder = fs.mkdtempSync(path.join(os.tmpdir(), "light4gs-viewers-"))] = process.argv.slice(2);
if (!file) {
  console.error("usage: node compare.mjs PROGRAM FILE.l4gs [FOLDER]");
  process.exit(2);
}
const run = (...args) => execFileSync(program, args, { encoding: "utf8" });
const at = (name) => path.join(folder, name);
fs.mkdirSync(folder, { recursive: true });
for (const name of ["scene.ply", "scene.glb"]) run("export", file, "--out", at(name), "--time", "0", "--device", "flex");
run("render", file, "--out", at("own"), "--path", "frozen", "--frames", `${VIEWS}`, "--width", `${SIZE}`, "--device", "flex");
const info = JSON.parse(run("info", file, "--json"));

const types = { ".html": "text/html", ".mjs": "text/javascript", ".js": "text/javascript" };
const server = http.createServer((request, response) => {
  const name = decodeURIComponent(request.url.split("?")[0]);
  const root = name.startsWith("/scene.") ? folder : here;
  fs.readFile(path.join(root, path.normalize(name)), (error, bytes) => {
    response.writeHead(error ? 404 : 200, { "content-type": types[path.extname(name)] ?? "application/octet-stream" });
    response.end(bytes);
  });
});
await new Promise((done) => server.listen(0, "127.0.0.1", done));
const address = `http://127.0.0.1:${server.address().port}/view.html`;

function psnr(a, b) {
  let sum = 0;
  for (let i = 0; i < a.data.length; i += 4) for (let c = 0; c < 3; c++) sum += (a.data[i + c] - b.data[i + c]) ** 2;
  return 10 * Math.log10((255 ** 2 * a.width * a.height * 3) / sum);
}

const browser = await puppeteer.launch({
  executablePath: CHROMIUM,
  args: ["--no-sandbox", "--use-gl=angle", "--use-angle=swiftshader", "--enable-unsafe-swiftshader"],
});
let worst = Infinity;
try {
  for (const name of ["scene.ply", "scene.glb"]) {
    for (let view = 0; view < VIEWS; view++) {
      const [radius, elevation] = [ORBIT[0], (ORBIT[1] * Math.PI) / 180];
      const angle = (2 * Math.PI * view) / VIEWS;
      const flat = -radius * Math.cos(elevation);
      const eye = [flat * Math.sin(angle), flat * Math.cos(angle), radius * Math.sin(elevation)];
      const page = await browser.newPage();
      page.on("pageerror", (error) => console.error(`${name}: ${error.message}`));
      await page.setViewport({ width: SIZE, height: SIZE });
      await page.goto(address);
      await page.waitForFunction("window.show");
      const fov = (info.fov_x * 180) / Math.PI;
      await page.evaluate((o) => window.show(o), { file: `/${name}`, size: SIZE, eye, fov, background: info.background });
      const shown = at(`${name.slice(6)}-${view}.png`);
      await page.screenshot({ path: shown });
      await page.close();
      const own = PNG.sync.read(fs.readFileSync(at(`own/${String(view).padStart(4, "0")}.png`)));
      const value = psnr(PNG.sync.read(fs.readFileSync(shown)), own);
      worst = Math.min(worst, value);
      console.log(`${name} view ${view}: ${value.toFixed(2)} dB against our rendering`);
    }
  }
} finally {
  await browser.close();
  server.close();
}
console.log(`pictures: ${folder}`);
if (!(worst >= LEAST_PSNR)) {
  console.error(`expected at least ${LEAST_PSNR} dB everywhere`);
  process.exit(1);
}
