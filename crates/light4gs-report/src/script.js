// Compares ground truth and render of one view behind a movable border. The images are those of the page.
(() => {
  const dialog = document.querySelector("dialog");
  if (!dialog || !dialog.showModal) return;
  const [truth, render] = dialog.querySelectorAll("img");
  const stack = dialog.querySelector(".stack");
  const slider = dialog.querySelector("input");
  const cut = () => stack.style.setProperty("--cut", slider.value + "%");
  slider.addEventListener("input", cut);
  stack.addEventListener("pointermove", (event) => {
    const box = stack.getBoundingClientRect();
    slider.value = ((event.clientX - box.left) / box.width) * 100;
    cut();
  });
  for (const button of document.querySelectorAll(".compare")) {
    button.hidden = false;
    button.addEventListener("click", () => {
      const figure = button.closest("figure");
      const images = figure.querySelectorAll("img");
      [truth, render].forEach((image, index) => {
        image.src = images[index].src;
        image.alt = images[index].alt;
      });
      stack.style.setProperty("--shape", images[0].naturalWidth / images[0].naturalHeight);
      dialog.querySelector("b").textContent = figure.querySelector("b").textContent;
      slider.value = 50;
      cut();
      dialog.showModal();
    });
  }
})();
