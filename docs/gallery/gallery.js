// The pictures of the gallery become players, in their places and one at a time. The first one does so by itself, or the one that the
// address names: gallery.html#play-NAME.

import "../light4gs-player.js";

/** What plays, and the link that it has taken the place of. */
let shown = null;

function play(link, byHand) {
  shown?.player.replaceWith(shown.link);
  const player = document.createElement("l4gs-player");
  for (const name of ["autoplay", "loop"]) player.setAttribute(name, "");
  if (link.dataset.cameras) player.setAttribute("cameras", link.dataset.cameras);
  player.setAttribute("src", link.getAttribute("href"));
  player.id = link.id;
  player.className = link.className;
  player.style.cssText = link.style.cssText;
  // What one moving camera has filmed looks right from its path.
  if ("follow" in link.dataset) player.addEventListener("load", () => (player.player.following = true));
  link.replaceWith(player);
  shown = { player, link };
  if (byHand) player.focus({ preventScroll: true });
}

const links = [...document.querySelectorAll("a.scene")];
for (const link of links) {
  link.setAttribute("role", "button");
  link.setAttribute("aria-label", `Play: ${link.querySelector("img").alt}`);
  link.addEventListener("click", (event) => {
    // With a key held, it is still a link to the file.
    if (event.ctrlKey || event.metaKey || event.shiftKey) return;
    event.preventDefault();
    play(link, true);
  });
}
const named = links.find(({ id }) => `#${id}` === location.hash);
const first = named ?? links[0];
if (first) play(first, false);
// The browser has looked for the place before it was a player.
if (named) shown.player.scrollIntoView({ block: "center" });
