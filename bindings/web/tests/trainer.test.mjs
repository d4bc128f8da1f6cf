// The page that trains. LIGHT4GS_TRAINER names the program that ./build-trainer makes, LIGHT4GS the one whose `view --trainer`
// serves the page; without it, the test does.

import assert from "node:assert/strict";
import { spawn } from "node:child_process";
import { mkdirSync, mkdtempSync, readFileSync, rmSync, writeFileSync } from "node:fs";
import { tmpdir } from "node:os";
import { after, before, test } from "node:test";
import { bundle, dist, launch, open, root, serve } from "./harness.mjs";

const folder = mkdtempSync(`${tmpdir()}/light4gs-trainer-`);
const SHORT = ["train.coarse_iterations=5", "train.fine_iterations=40", "train.checkpoint_interval=20", "train.log_interval=10", "compression.context.fit_iterations=5"];
/** @type {Awaited<ReturnType<typeof launch>>} */
let browser;
let server;

/** The page as the program serves it. */
async function view(program, trainer) {
  const child = spawn(program, ["view", "--trainer", trainer]);
  const url = await new Promise((resolve, reject) => {
    // The address is the first line.
    child.stdout.once("data", (text) => resolve(/http:\S+/.exec(text)[0]));
    child.on("exit", (code) => reject(new Error(`${program} view --trainer: exit code ${code}`)));
  });
  return { url, close: () => child.kill() };
}

before(async () => {
  browser = await launch();
  const trainer = process.env.LIGHT4GS_TRAINER ?? `${root}/target/wasm-trainer/wasm32-wasip1/quick/light4gs-web-trainer.wasm`;
  const program = process.env.LIGHT4GS;
  server = program ? await view(program, trainer) : await serve({
    "": readFileSync(`${dist}/trainer.html`),
    "light4gs-player.js": bundle(),
    "light4gs-trainer.js": readFileSync(`${dist}/light4gs-trainer.js`),
    "light4gs-web-trainer.wasm": readFileSync(trainer),
  });
});
after(async () => {
  await browser?.close();
  server?.close();
  rmSync(folder, { recursive: true });
});

/** Trains to the end, and returns the page. */
async function train(settings) {
  const page = await open(browser, server.url);
  await page.fill("#settings", settings.join("\n"));
  await page.click("#train");
  await page.waitForFunction(() => /^(Done|Failed)/.test(document.getElementById("status").textContent), null, { timeout: 600_000 });
  return page;
}
const status = (page) => page.textContent("#status");
const bytesOf = (page, id) => page.evaluate(async (link) => [...new Uint8Array(await (await fetch(document.getElementById(link).href)).arrayBuffer())], id);

test("the synthetic scene is trained, shown, and can be kept", { timeout: 900_000 }, async () => {
  const page = await train(SHORT);
  assert.match(await status(page), /^Done: \d+\.\d\d dB on the test views, \d+ kB/);
  const scene = Buffer.from(await bytesOf(page, "download"));
  assert.equal(scene.subarray(1, 5).toString(), "L4GS", scene.subarray(0, 8).toString("hex"));
  assert.match(Buffer.from(await bytesOf(page, "report")).toString(), /<html/);
  const shown = await page.evaluate(() => {
    const { player } = document.getElementById("player");
    const picture = document.getElementById("picture");
    return { count: player.scene.info.count, moves: player.scene.info.moves, picture: [picture.naturalWidth, picture.naturalHeight] };
  });
  assert.ok(shown.count > 100 && shown.moves, JSON.stringify(shown));
  assert.equal(shown.picture[0], 2 * shown.picture[1]);
  // The report is a page of its own, under the policy of this one.
  const [report] = await Promise.all([page.context().waitForEvent("page"), page.click("#report")]);
  await report.waitForFunction(() => document.querySelector("l4gs-player")?.player?.scene.count > 100);
  assert.ok(await page.evaluate(() => document.querySelector("#curve polyline").getAttribute("points").split(" ").length) >= 4);
  assert.deepEqual(page.problems, []);
  await page.context().close();
});

test("a wrong setting and a folder without a dataset are said", { timeout: 300_000 }, async () => {
  const page = await train(["train.fine_iteration=3"]);
  assert.match(await status(page), /^Failed: .*train\.fine_iteration.*fine_iterations/s);
  const empty = `${folder}/empty`;
  mkdirSync(empty);
  writeFileSync(`${empty}/notes.txt`, "nothing");
  await page.setInputFiles("#folder", empty);
  await page.click("#train");
  await page.waitForFunction(() => /^Failed: .*layout/s.test(document.getElementById("status").textContent), null, { timeout: 60_000 });
  assert.deepEqual(page.problems, []);
  await page.context().close();
});

test("a training can be stopped, and begun again", { timeout: 300_000 }, async () => {
  const page = await open(browser, server.url);
  await page.click("#train");
  await page.waitForFunction(() => /iteration/.test(document.getElementById("status").textContent), null, { timeout: 240_000 });
  await page.click("#stop");
  assert.equal(await status(page), "Stopped");
  await page.fill("#settings", SHORT.join("\n"));
  await page.click("#train");
  await page.waitForFunction(() => /^fine stage/.test(document.getElementById("status").textContent), null, { timeout: 120_000 });
  assert.deepEqual(page.problems, []);
  await page.context().close();
});
