// Runs in the browser: compiles kernels, and launches them on buffers that were written down elsewhere.

/** Differences that a launch may have, as a share of the largest magnitude in the buffer; integers must be the same. */
const ALLOWED = 1e-6;

/** Keys of a buffer of mixed words are smaller, and the bits of a depth: one more is this share of it. */
const [KEYS, SHARE_OF_KEY] = [2 ** 28, 2 ** -23];

let device, kernels, scenes, pieces, contents;

/** What browsers want before a text. The variant for Mesa's software driver says so itself that it proves less. */
function directives({ name, text }) {
  const enable = /\bsubgroup[A-Z]\w*\(/.test(text) ? "enable subgroups;\n" : "";
  return enable + (name.endsWith(" SubgroupOfMesa") ? "diagnostic(off, subgroup_uniformity);\n" : "");
}

/** Loads what is to be done; what the adapter says of itself, or null if there is none. */
export async function begin() {
  const adapter = await navigator.gpu?.requestAdapter();
  if (!adapter) return null;
  // With the limits that every adapter has.
  device = await adapter.requestDevice({ requiredFeatures: ["subgroups"] });
  ({ kernels, scenes, pieces } = await (await fetch("/launches.json")).json());
  contents = await (await fetch("/blobs.bin")).arrayBuffer();
  for (const kernel of kernels) {
    kernel.buffers = [...kernel.text.matchAll(/@binding\((\d+)\) var<storage, read_write> (\w+): array<(.+?)>;/g)]
      .map(([, , name, type]) => ({ name, difference: type === "vec4<u32>" ? ofWords : /[iu]32/.test(type) ? ofIntegers : ofFloats }));
  }
  const { vendor, architecture, subgroupMinSize, subgroupMaxSize } = adapter.info;
  return { vendor, architecture, subgroups: [subgroupMinSize, subgroupMaxSize] };
}

/**
 * What the compiler says of each kernel: warnings are problems too. A pipeline is made where its limits may differ, or where it
 * is launched; kernels for other planes differ in nothing but constants.
 */
export function compile() {
  const alike = new Set();
  const launched = new Set(scenes.flatMap(({ launches }) => launches.map(({ kernel }) => kernel)));
  return Promise.all(kernels.map(async (kernel, number) => {
    const problems = [];
    const kind = kernel.name.replace(/ AXIS_PAIRS=\d+/, "");
    const needed = launched.has(number) || !alike.has(kind);
    alike.add(kind);
    const module = device.createShaderModule({ code: directives(kernel) + kernel.text });
    for (const { type, lineNum, message } of (await module.getCompilationInfo()).messages) problems.push(`${type}, line ${lineNum}: ${message}`);
    if (!problems.length && needed) {
      try {
        kernel.pipeline = await device.createComputePipelineAsync({ layout: "auto", compute: { module, entryPoint: "main" } });
      } catch (error) {
        problems.push(error.message);
      }
    }
    return { kernel: number, problems };
  }));
}

const piece = (number) => new Uint8Array(contents, pieces[number][0], pieces[number][1]);

function buffer(size, usage, bytes) {
  const made = device.createBuffer({ size, usage: usage | GPUBufferUsage.COPY_SRC | GPUBufferUsage.COPY_DST });
  if (bytes) device.queue.writeBuffer(made, 0, bytes);
  return made;
}

/** Launches a kernel. `inputs` has a piece's number or a buffer for each binding; returns the buffers. */
function dispatch({ kernel, groups, uniform }, inputs) {
  const encoder = device.createCommandEncoder();
  const buffers = inputs.map((input) => {
    if (typeof input === "number") return buffer(pieces[input][1], GPUBufferUsage.STORAGE, piece(input));
    const copy = buffer(input.size, GPUBufferUsage.STORAGE);
    encoder.copyBufferToBuffer(input, 0, copy, 0, input.size);
    return copy;
  });
  const bound = [...buffers];
  if (uniform.length) bound.push(buffer(4 * uniform.length, GPUBufferUsage.UNIFORM, new Uint32Array(uniform)));
  const { pipeline } = kernels[kernel];
  const entries = bound.map((buffer, binding) => ({ binding, resource: { buffer } }));
  const pass = encoder.beginComputePass();
  pass.setPipeline(pipeline);
  pass.setBindGroup(0, device.createBindGroup({ layout: pipeline.getBindGroupLayout(0), entries }));
  pass.dispatchWorkgroups(...groups);
  pass.end();
  device.queue.submit([encoder.finish()]);
  return buffers;
}

async function read(source) {
  const target = device.createBuffer({ size: source.size, usage: GPUBufferUsage.MAP_READ | GPUBufferUsage.COPY_DST });
  const encoder = device.createCommandEncoder();
  encoder.copyBufferToBuffer(source, 0, target, 0, source.size);
  device.queue.submit([encoder.finish()]);
  await target.mapAsync(GPUMapMode.READ);
  const copy = target.getMappedRange().slice(0);
  target.destroy();
  return copy;
}

/** The largest difference, and where it is. Equal bits are equal, NaN as well. */
function difference(found, expected, off = (f, e) => Math.abs(f - e)) {
  let [error, at] = [0, 0];
  for (let i = 0; i < expected.length; i++) {
    const here = Object.is(found[i], expected[i]) ? 0 : off(found[i], expected[i], i);
    if (!(here <= error)) [error, at] = [Number.isNaN(here) ? Infinity : here, i];
  }
  return { error, at: `[${at}]: ${found[at]} for ${expected[at]}` };
}

const ofIntegers = (found, expected) => ({ ...difference(new Uint32Array(found), new Uint32Array(expected)), allowed: 0 });

function largest(floats) {
  return floats.reduce((most, value) => (Number.isFinite(value) ? Math.max(most, Math.abs(value)) : most), 1e-30);
}

function ofFloats(found, expected) {
  const floats = new Float32Array(expected);
  const { error, at } = difference(new Float32Array(found), floats);
  return { error: error / largest(floats), at, allowed: ALLOWED };
}

/** Words that are bits of floats, and keys made of them. */
function ofWords(found, expected) {
  const [left, right] = [new Float32Array(found), new Float32Array(expected)];
  const scale = largest(right);
  const off = (f, e, i) => (Math.max(f, e) < KEYS ? SHARE_OF_KEY * Math.abs(f - e) : Math.abs(left[i] - right[i]) / scale);
  return { ...difference(new Uint32Array(found), new Uint32Array(expected), off), allowed: ALLOWED };
}

/** One scene: every launch by itself, then all of them one after the other. */
export async function run(index) {
  const { launches, outcomes } = scenes[index];
  const compared = [];
  for (const launch of launches) {
    const { kernel } = launch;
    device.pushErrorScope("validation");
    const results = dispatch(launch, launch.buffers.map(([before]) => before));
    const buffers = [];
    const found = await Promise.all(results.map((buffer, place) => launch.buffers[place][1] !== null && read(buffer)));
    for (const [place, [, after]] of launch.buffers.entries()) {
      if (after === null) continue;
      const { name, difference } = kernels[kernel].buffers[place];
      buffers.push({ buffer: name, ...difference(found[place], piece(after).slice().buffer) });
    }
    results.forEach((buffer) => buffer.destroy());
    compared.push({ kernel, buffers, problem: (await device.popErrorScope())?.message });
  }

  // The outputs of a launch replace those that were written down: a later launch that read the old ones gets the new
  // ones.
  const made = new Map();
  const all = launches.map((launch) => {
    const results = dispatch(launch, launch.buffers.map(([before]) => made.get(before) ?? before));
    launch.buffers.forEach(([, after], place) => after !== null && made.set(after, results[place]));
    return results;
  });
  const found = [];
  for (const { what, launch, buffer, word, expected, tolerance } of outcomes) {
    const values = new Float32Array(piece(expected).slice().buffer);
    const results = new Float32Array(await read(all[launch][buffer])).subarray(word, word + values.length);
    found.push({ what, tolerance, ...difference(results, values) });
  }
  all.flat().forEach((buffer) => buffer.destroy());
  return { compared, outcomes: found };
}
