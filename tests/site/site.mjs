// The site in headless Chromium: see .ci/site-try.

import { spawn, execFileSync } from "node:child_process";
import { mkdtempSync, readFileSync, readdirSync, rmSync, statSync, symlinkSync, mkdirSync, writeFileSync } from "node:fs";
import { loadavg, tmpdir } from "node:os";
import { join } from "node:path";
import { parseArgs } from "node:util";
import { launch, root } from "../../bindings/web/tests/harness.mjs";
import { emulate } from "../../bindings/web/tests/take_measures.mjs";

const { values } = parseArgs({
  options: { report: { type: "string" }, bound: { type: "string", default: process.env.LIGHT4GS_WEB_STRICT ? "2000" : "10000" }, only: { type: "string", default: "pages,search,gallery,first,export" } },
});
const parts = values.only.split(",");
const site = `${root}/target/site`;
/** Below the root of the server, so that an address that begins with a slash is not found. */
const FOLDER = "some/place";
const CONDITIONS = { megabits: 10, latency: 20 };
const WIDTHS = [1000, 390];

const problems = [];
const problem = (where, what) => problems.push(`${where}: ${what}`);
const measured = { commit: execFileSync("git", ["describe", "--always", "--dirty", "--abbrev=8"], { cwd: root, encoding: "utf8" }).trim(), conditions: CONDITIONS };

/** A static server as the pages name it. */
async function serve(folder) {
  const server = spawn("python3", ["-u", "-m", "http.server", "0", "--bind", "127.0.0.1", "--directory", folder], { stdio: ["ignore", "pipe", "ignore"] });
  const port = await new Promise((resolve, reject) => {
    server.stdout.on("data", (text) => resolve(/port (\d+)/.exec(text)?.[1]));
    server.on("exit", (code) => reject(new Error(`python3 -m http.server ended with ${code}`)));
  });
  return { url: `http://127.0.0.1:${port}`, close: () => server.kill() };
}

/** A page of a context of its own; what its console, its scripts and its requests have to say becomes a problem. */
async function open(browser, { width = WIDTHS[0] } = {}) {
  const context = await browser.newContext({ viewport: { width, height: 900 } });
  context.setDefaultTimeout(60_000);
  const page = await context.newPage();
  const here = () => page.url().replace(/^http:\/\/[^/]*\//, "");
  page.on("console", (message) => problem(here(), `console: ${message.type()}: ${message.text()}`));
  page.on("pageerror", (error) => problem(here(), `script: ${error}`));
  page.on("requestfailed", (request) => {
    // What a page asked for when it was left.
    if (request.failure()?.errorText !== "net::ERR_ABORTED") problem(here(), `request: ${request.url()}: ${request.failure()?.errorText}`);
  });
  page.on("response", (response) => {
    if (response.status() >= 400) problem(here(), `request: ${response.url()}: ${response.status()}`);
  });
  return page;
}

const filesBelow = (folder, under = "") =>
  readdirSync(join(folder, under), { withFileTypes: true }).flatMap((entry) => {
    const path = join(under, entry.name);
    return entry.isDirectory() ? filesBelow(folder, path) : [path];
  });

/** Every page as it looks: tables that are text, and what is wider than the page. Its links and the places that links may name. */
async function pages(browser, base) {
  // toc.html is shown inside of the others where there is no script.
  const names = filesBelow(site).filter((name) => name.endsWith(".html") && !name.startsWith("api/") && name !== "toc.html");
  const places = new Map();
  const links = new Map();
  const look = async (page, name) => {
    await page.goto(`${base}/${name}`, { waitUntil: "load" });
    return page.evaluate(() => ({
      text: document.querySelector("main")?.innerText ?? "",
      wider: document.documentElement.scrollWidth - document.documentElement.clientWidth,
      places: [...document.querySelectorAll("[id]")].map(({ id }) => id),
      links: [...document.querySelectorAll("a[href]")].map(({ href }) => href),
      flat: [...document.querySelectorAll("l4gs-player")].filter(({ canvas }) => !(canvas?.clientHeight > 100)).length,
      empty: [...document.images].filter((image) => image.loading !== "lazy" && image.naturalWidth === 0).map(({ src }) => src),
    }));
  };
  for (const width of WIDTHS) {
    const page = await open(browser, { width });
    for (const name of names) {
      const seen = await look(page, name);
      if (seen.wider > 0) problem(name, `is ${seen.wider} pixels wider than a window of ${width}`);
      if (seen.flat > 0) problem(name, `a player without height in a window of ${width}`);
      if (width !== WIDTHS[0]) continue;
      if (/\|\s*:?---/.test(seen.text)) problem(name, "a table is shown as text");
      if (/^```/m.test(seen.text)) problem(name, "a block of code is shown as text");
      for (const image of seen.empty) problem(name, `an image without a picture: ${image}`);
      places.set(`${base}/${name}`, new Set(seen.places));
      for (const link of seen.links) if (!links.has(link)) links.set(link, name);
    }
    await page.context().close();
  }
  // Every link, once: the file is there, and the place in it.
  const own = [...links].filter(([link]) => link.startsWith(`${base}/`));
  const elsewhere = [...links.keys()].filter((link) => !link.startsWith(base));
  for (const link of elsewhere) {
    if (!/^https:\/\//.test(link)) problem(links.get(link), `a link that leaves the site, and not to https: ${link}`);
  }
  const page = await open(browser);
  for (const [link, name] of own) {
    const { pathname, hash, origin } = new URL(link);
    const file = pathname.endsWith("/") ? `${origin}${pathname}index.html` : origin + pathname;
    const place = decodeURIComponent(hash.slice(1));
    if (places.has(file)) {
      if (place && !places.get(file).has(place)) problem(name, `a link to a place that is not there: ${link}`);
      continue;
    }
    const answer = await fetch(file, { method: "HEAD" });
    if (!answer.ok) problem(name, `a link to what is not there: ${link}: ${answer.status}`);
    else if (file.endsWith(".html")) places.set(file, new Set((await look(page, file.slice(base.length + 1))).places));
  }
  await page.context().close();
  measured.pages = { pages: names.length, links: own.length, links_elsewhere: elsewhere.length };
}

/** A word of the pages is found, and its result leads to a page that has it. */
async function search(browser, base) {
  const page = await open(browser);
  await page.goto(`${base}/index.html`);
  await page.locator("#mdbook-search-toggle, #search-toggle").click();
  const result = page.locator("#mdbook-searchresults a, #searchresults a").first();
  const bar = page.locator("#mdbook-searchbar, #searchbar");
  // What is written before the index has come is not searched for.
  for (let tries = 0; tries < 60 && !(await result.isVisible()); tries++) {
    await bar.fill("");
    await bar.pressSequentially("checkerboard");
    await page.waitForTimeout(1000);
  }
  await result.click();
  await page.waitForLoadState();
  if (!/checkerboard/i.test(await page.locator("main").innerText())) problem("search", `the first result does not have the word: ${page.url()}`);
  measured.search = page.url().slice(base.length + 1).replace(/\?[^#]*/, "");
  await page.context().close();
}

/** When the players of a page have shown their first images: milliseconds since the page was asked for. */
const noteImages = () => {
  globalThis.firstImages = [];
  document.addEventListener("load", ({ target }) => {
    if (target.localName !== "l4gs-player") return;
    target.player.renderer.finish();
    globalThis.firstImages.push({ source: target.getAttribute("src"), at: performance.now() });
  }, true);
  document.addEventListener("error", ({ target, detail }) => {
    if (target.localName === "l4gs-player") console.error(`${target.getAttribute("src")}: ${detail?.message}`);
  }, true);
};
async function firstImage(page, source) {
  try {
    const found = await page.waitForFunction((wanted) => globalThis.firstImages.find(({ source }) => source === wanted)?.at, source);
    return await found.jsonValue();
  } catch (error) {
    const said = await page.evaluate(() => [...document.querySelectorAll("l4gs-player")].map(({ shadowRoot }) => shadowRoot.getElementById("stage").innerText.trim()));
    throw new Error(`${page.url()}: no image of ${source}; players say: ${JSON.stringify(said)}; ${problems.join("; ")}`, { cause: error });
  }
}

/** Whether what a player shows moves, and is more than one color. */
async function plays(page, where) {
  const player = page.locator("l4gs-player");
  const state = () => page.evaluate(() => {
    const { player } = document.querySelector("l4gs-player");
    return { time: player.time, playing: player.playing };
  });
  const before = await state();
  const first = await player.screenshot();
  await page.waitForFunction((time) => document.querySelector("l4gs-player").player.time !== time, before.time);
  await page.waitForTimeout(300);
  const second = await player.screenshot();
  if (!before.playing) problem(where, "does not play");
  if (first.equals(second)) problem(where, "its image does not change");
  // A picture of one color is a few kilobytes.
  if (first.length < 8000) problem(where, "shows nothing");
}

const scenesOf = (page) => page.locator("a.scene, l4gs-player.scene").evaluateAll((all) => all.map((one) => one.getAttribute("href") ?? one.getAttribute("src")));

/** The first scene plays by itself, each other one after a click, one at a time. */
async function gallery(browser, base) {
  const page = await open(browser);
  await page.addInitScript(noteImages);
  await page.goto(`${base}/gallery.html`);
  const scenes = await scenesOf(page);
  for (const [number, scene] of scenes.entries()) {
    if (number > 0) await page.locator(`a.scene[href="${scene}"]`).click();
    await firstImage(page, scene);
    await plays(page, scene);
    if ((await page.locator("l4gs-player").count()) !== 1) problem(scene, "another one plays beside it");
  }
  measured.gallery = { scenes: scenes.length };
  await page.context().close();
}

/**
 * The first image of each scene in a browser that has never seen the site, from the click on a link to it. Other work of the machine
 * makes it later: up to three tries.
 */
async function first(browser, base) {
  const bound = Number(values.bound);
  const asked = await open(browser);
  await asked.goto(`${base}/gallery.html`);
  const scenes = await scenesOf(asked);
  await asked.context().close();
  measured.first_image = { bound, load_before: loadavg()[0], milliseconds: {} };
  for (const scene of scenes) {
    const name = scene.replace(/^.*\//, "").replace(/\.l4gs$/, "");
    const tries = (measured.first_image.milliseconds[name] = []);
    do {
      const page = await open(browser);
      await page.addInitScript(noteImages);
      await emulate(page, CONDITIONS);
      await page.goto(`${base}/gallery.html#play-${name}`, { waitUntil: "commit" });
      tries.push(Math.round(await firstImage(page, scene)));
      await page.context().close();
    } while (Math.min(...tries) > bound && tries.length < 3);
    if (Math.min(...tries) > bound) problem(name, `its first image takes ${tries.join(", ")} ms at ${CONDITIONS.megabits} Mbit/s; the bound is ${bound}`);
  }
  measured.first_image.load_after = loadavg()[0];
}

/** The folder that `export --site` writes, in place of the site. */
async function exported(browser, url, folder) {
  const program = process.env.LIGHT4GS;
  if (!program) return console.log("export --site: not tried, since LIGHT4GS names no program");
  const [scene] = readdirSync(`${site}/gallery`).filter((name) => name.endsWith(".l4gs"));
  execFileSync(program, ["export", `${site}/gallery/${scene}`, "--site", join(folder, "mine/scene")], { stdio: ["ignore", "ignore", "inherit"] });
  const page = await open(browser);
  await page.addInitScript(noteImages);
  await page.goto(`${url}/mine/scene/`);
  await firstImage(page, "scene.l4gs");
  await plays(page, "export --site");
  const picture = await page.locator('meta[property="og:image"]').getAttribute("content");
  const answer = await fetch(new URL(picture, page.url()));
  if (!answer.ok) problem("export --site", `its picture is not there: ${picture}`);
  measured.exported = Object.fromEntries(filesBelow(join(folder, "mine/scene")).map((name) => [name, statSync(join(folder, "mine/scene", name)).size]));
  await page.context().close();
}

statSync(`${site}/index.html`, { throwIfNoEntry: false }) ?? (console.error("target/site is not there: .ci/site makes it"), process.exit(1));
const folder = mkdtempSync(join(tmpdir(), "light4gs-site-"));
mkdirSync(join(folder, "some"));
symlinkSync(site, join(folder, FOLDER));
const server = await serve(folder);
const browser = await launch();
try {
  const base = `${server.url}/${FOLDER}`;
  const work = {
    first: () => first(browser, base),
    pages: () => pages(browser, base),
    search: () => search(browser, base),
    gallery: () => gallery(browser, base),
    export: () => exported(browser, server.url, folder),
  };
  for (const part of Object.keys(work).filter((part) => parts.includes(part))) {
    await work[part]().catch((error) => problem(part, error.message));
  }
} finally {
  await browser.close();
  server.close();
  rmSync(folder, { recursive: true });
}
console.log(JSON.stringify(measured, null, 1));
if (values.report) writeFileSync(values.report, `${JSON.stringify(measured, null, 1)}\n`);
for (const line of new Set(problems)) console.error(line);
console.log(`${new Set(problems).size} problems`);
process.exit(problems.length > 0 ? 1 : 0);
