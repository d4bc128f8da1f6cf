// The list of the dataset's cameras, in groups by split.

/** @typedef {import("../views/camera.js").DatasetCamera} DatasetCamera */

/**
 * @param {HTMLSelectElement} select
 * @param {DatasetCamera[]} cameras
 * @param {boolean} withPath  whether there is a training path to follow
 */
export function fillCameras(select, cameras, withPath) {
  select.replaceChildren(new Option("Free view", "free"));
  if (withPath) select.append(new Option("Training path", "path"));
  /** @type {Map<string, HTMLOptGroupElement>} */
  const groups = new Map();
  cameras.forEach(({ name, split, time }, index) => {
    const key = split ?? "cameras";
    let group = groups.get(key);
    if (!group) {
      group = document.createElement("optgroup");
      group.label = key;
      groups.set(key, group);
      select.append(group);
    }
    group.append(new Option(`${name ?? index}${time === undefined ? "" : ` · ${time.toFixed(2)}`}`, String(index)));
  });
}
