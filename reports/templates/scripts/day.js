"use strict";
// The animation of a day: plays when it is scrolled to, unless reduced motion is wished for; it can be stopped.

const SECONDS_A_FRAME = 0.45;

for (const root of document.querySelectorAll(".day")) {
  const frames = [...root.querySelectorAll(".frames img")];
  const slider = root.querySelector("input[type=range]");
  const button = root.querySelector("[data-day=play]");
  const output = root.querySelector("output");
  let timer = null;

  const show = (index) => {
    frames.forEach((frame, place) => (frame.hidden = place !== index));
    slider.value = index;
    slider.setAttribute("aria-valuetext", frames[index].dataset.label);
    output.textContent = frames[index].dataset.label;
  };
  const stop = () => {
    clearInterval(timer);
    timer = null;
    button.textContent = "Play";
    button.setAttribute("aria-pressed", "false");
  };
  const play = () => {
    timer = setInterval(() => show((Number(slider.value) + 1) % frames.length), 1000 * SECONDS_A_FRAME);
    button.textContent = "Pause";
    button.setAttribute("aria-pressed", "true");
  };

  slider.max = frames.length - 1;
  slider.addEventListener("input", () => {
    stop();
    show(Number(slider.value));
  });
  button.addEventListener("click", () => (timer ? stop() : play()));
  root.addEventListener("keydown", (event) => {
    if (event.key === "Escape" && timer) stop();
  });
  root.querySelector(".day-controls").hidden = false;
  root.classList.add("ready");
  show(Math.floor(frames.length / 2));
  const isStill = matchMedia("(prefers-reduced-motion: reduce)").matches;
  if (!isStill) {
    new IntersectionObserver((entries, observer) => {
      if (!entries[0].isIntersecting) return;
      observer.disconnect();
      play();
    }).observe(root);
  }
}
