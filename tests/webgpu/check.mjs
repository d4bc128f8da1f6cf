// Every WGSL kernel in Chromium's WebGPU, on its software adapter (SwiftShader): compiled, then run on the launches that the
// test `launches_of_golden_scenes` has written down. usage: node check.mjs FOLDER
// Each launch gets the inputs that it got there, and must give the same outputs. Then each scene is run once more from
// one launch to the next, with its own results, and the last ones must be those of the golden vectors. The exit code is
// 77 if this browser has no adapter.

import { readFileSync } from "node:fs";
import { fileURLToPath } from "node:url";
import { launch, open, serve } from "../../bindings/web/tests/harness.mjs";

const folder = process.argv[2];
if (!folder) throw new Error("usage: node check.mjs FOLDER");
const { kernels, scenes } = JSON.parse(readFileSync(`${folder}/launches.json`, "utf8"));

const server = await serve({
  "": "<!doctype html><link rel=icon href='data:,'>",
  "replay.js": readFileSync(fileURLToPath(new URL("replay.js", import.meta.url))),
  "launches.json": readFileSync(`${folder}/launches.json`),
  "blobs.bin": readFileSync(`${folder}/blobs.bin`),
});
const browser = await launch(["--enable-unsafe-webgpu", "--use-webgpu-adapter=swiftshader", "--enable-features=Vulkan", "--use-vulkan=swiftshader"]);
let exitCode = 1;
try {
  exitCode = await check(await open(browser, server.url));
} finally {
  await browser.close();
  server.close();
}
process.exitCode = exitCode;

async function check(page) {
  const adapter = await page.evaluate(async () => {
    globalThis.replay = await import("/replay.js");
    return globalThis.replay.begin();
  });
  if (!adapter) {
    console.error("NOT RUN: this Chromium has no WebGPU adapter");
    return 77;
  }
  console.log(`${adapter.vendor} ${adapter.architecture}, subgroups of ${adapter.subgroups.join(" to ")}, limits that every adapter has`);
  let failures = 0;
  const fail = (message) => {
    failures += 1;
    console.error(`FAILED: ${message}`);
  };

  let start = performance.now();
  const seconds = () => `${((performance.now() - start) / 1000).toFixed(1)} s`;
  for (const { kernel, problems } of await page.evaluate(() => globalThis.replay.compile())) {
    if (problems.length) fail(`${kernels[kernel].name} does not compile\n  ${problems.join("\n  ")}`);
  }
  console.log(`${kernels.length} kernels compiled, ${seconds()}`);
  if (failures) return 1;

  start = performance.now();
  const worst = new Map();
  let launches = 0;
  for (const [index, { name }] of scenes.entries()) {
    const { compared, outcomes } = await page.evaluate((scene) => globalThis.replay.run(scene), index);
    for (const { kernel, problem, buffers } of compared) {
      launches += 1;
      if (problem) fail(`${name}: ${kernels[kernel].name}: ${problem}`);
      for (const { buffer, error, allowed, at } of buffers) {
        const kind = kernels[kernel].name.split(" ")[0];
        const before = worst.get(kind) ?? 0;
        worst.set(kind, Math.max(before, error));
        if (!(error <= allowed)) fail(`${name}: ${kernels[kernel].name}: ${buffer} ${at}: off by ${error.toExponential(2)}, allowed ${allowed}`);
      }
    }
    for (const { what, error, tolerance, at } of outcomes) {
      if (!(error <= tolerance)) fail(`${name}, from launch to launch: ${what} ${at}: off by ${error.toExponential(2)}, allowed ${tolerance.toExponential(2)}`);
    }
    const share = Math.max(0, ...outcomes.map(({ error, tolerance }) => error / tolerance));
    console.log(`${name}: ${compared.length} launches${outcomes.length ? `; ${outcomes.length} outcomes, at most ${share.toFixed(2)} of their tolerance` : ""}`);
  }
  console.log(`largest difference of a launch, as a share of the buffer's largest value:`);
  console.log([...worst].map(([kind, error]) => `  ${kind} ${error.toExponential(1)}`).join("\n"));
  for (const problem of page.problems) fail(problem);
  console.log(`${launches} launches of ${worst.size} kernels run, ${seconds()}`);
  return failures ? 1 : 0;
}
