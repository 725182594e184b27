"use strict";
// The image viewer: two panes with one zoom, a divider between ours and the reference, maps, and a pixel probe.

const ZOOMS = [1, 2, 4, 8, 16];
const DIVIDER_STEP = 2;

class Viewer {
  constructor(root) {
    this.root = root;
    this.live = root.querySelector(".live");
    this.slider = root.querySelector(".divider input");
    this.canvases = { left: root.querySelector("[data-pane=left]"), right: root.querySelector("[data-pane=right]") };
    this.pictures = root.querySelectorAll(".printed img");
    this.sources = {};
    this.reset();
  }

  async start() {
    this.pixels = await readPixels(this.root.querySelector(".viewer-data").textContent);
    await Promise.all([this.pictures[0].decode(), this.pictures[1].decode()]);
    this.root.classList.add("ready");
    this.live.hidden = false;
    this.listen();
    this.resize();
    new ResizeObserver(() => this.resize()).observe(this.canvases.left);
  }

  reset() {
    this.left = "picture";
    this.right = "difference";
    this.zoom = 0;
    this.centre = [0.5, 0.5];
    this.probe = null;
    this.pinned = false;
    this.slider.value = 50;
  }

  listen() {
    this.slider.addEventListener("input", () => this.draw());
    for (const [side, name] of [["left", "left"], ["right", "right"]]) {
      for (const input of this.live.querySelectorAll(`input[type=radio][name^=${name}-]`)) {
        input.addEventListener("change", () => this.show(side, input.value));
      }
    }
    for (const button of this.live.querySelectorAll("[data-zoom=in], [data-zoom=out]")) {
      button.addEventListener("click", () => this.zoomBy(button.dataset.zoom === "in" ? 1 : -1));
    }
    for (const canvas of Object.values(this.canvases)) {
      canvas.addEventListener("pointermove", (event) => this.point(event, canvas));
      canvas.addEventListener("pointerdown", (event) => this.press(event, canvas));
      canvas.addEventListener("pointerup", (event) => this.release(event, canvas));
    }
    this.live.addEventListener("keydown", (event) => this.key(event));
  }

  // Keys of the focused viewer, or of the one pointed at. True keys of a control (its arrows) stay the control's.
  key(event) {
    if (event.ctrlKey || event.metaKey || event.altKey) return;
    const isRadio = event.target instanceof HTMLInputElement && event.target.type === "radio";
    const steps = { ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, -1], ArrowDown: [0, 1] };
    const step = steps[event.key];
    if (step && event.shiftKey) this.moveProbe(step);
    else if (step && step[0] && !isRadio) this.setDivider(Number(this.slider.value) + DIVIDER_STEP * step[0]);
    else if (step) return;
    else if (!this.letter(event.key)) return;
    event.preventDefault();
    event.stopPropagation();
  }

  letter(name) {
    const actions = {
      1: () => this.setDivider(100),
      2: () => this.setDivider(0),
      d: () => this.show("right", "difference"),
      n: () => this.show("right", "noise"),
      p: () => this.show("left", "picture"),
      l: () => this.show("left", "luminance"),
      e: () => this.show("left", "illuminance"),
      "+": () => this.zoomBy(1),
      "=": () => this.zoomBy(1),
      "-": () => this.zoomBy(-1),
      escape: () => this.restart(),
    };
    const action = actions[name.toLowerCase()];
    if (action) action();
    return Boolean(action);
  }

  restart() {
    this.reset();
    this.show("left", "picture");
    this.show("right", "difference");
    this.describe();
  }

  setDivider(share) {
    this.slider.value = Math.min(100, Math.max(0, share));
    this.draw();
  }

  show(side, name) {
    this[side] = name;
    const pane = this.canvases[side].closest(".pane");
    for (const input of pane.querySelectorAll("input[type=radio]")) input.checked = input.value === name;
    for (const legend of pane.querySelectorAll(".legend")) legend.hidden = legend.dataset.scale !== name;
    this.draw();
  }

  zoomBy(steps) {
    this.zoom = Math.min(ZOOMS.length - 1, Math.max(0, this.zoom + steps));
    if (this.probe) this.centre = [(this.probe[0] + 0.5) / this.pixels.width, (this.probe[1] + 0.5) / this.pixels.height];
    this.draw();
  }

  // The part of the picture that is shown, in pixels: x, y, width, height.
  window() {
    const { width, height } = this.pixels;
    const scale = ZOOMS[this.zoom];
    const [w, h] = [width / scale, height / scale];
    const x = Math.min(width - w, Math.max(0, this.centre[0] * width - w / 2));
    const y = Math.min(height - h, Math.max(0, this.centre[1] * height - h / 2));
    return [x, y, w, h];
  }

  pixelAt(event, canvas) {
    const box = canvas.getBoundingClientRect();
    const [x, y, w, h] = this.window();
    const column = Math.floor(x + ((event.clientX - box.left) / box.width) * w);
    const row = Math.floor(y + ((event.clientY - box.top) / box.height) * h);
    return [Math.min(this.pixels.width - 1, Math.max(0, column)), Math.min(this.pixels.height - 1, Math.max(0, row))];
  }

  point(event, canvas) {
    if (this.drag) this.pan(event, canvas);
    else if (!this.pinned) this.setProbe(this.pixelAt(event, canvas));
  }

  press(event, canvas) {
    canvas.setPointerCapture(event.pointerId);
    this.drag = { x: event.clientX, y: event.clientY, centre: this.centre, moved: false };
  }

  pan(event, canvas) {
    const box = canvas.getBoundingClientRect();
    const scale = ZOOMS[this.zoom];
    const [dx, dy] = [event.clientX - this.drag.x, event.clientY - this.drag.y];
    if (Math.hypot(dx, dy) > 4) this.drag.moved = true;
    const [x, y] = this.drag.centre;
    const half = 0.5 / scale;
    const within = (value) => Math.min(1 - half, Math.max(half, value));
    this.centre = [within(x - dx / box.width / scale), within(y - dy / box.height / scale)];
    this.draw();
  }

  release(event, canvas) {
    const moved = this.drag && this.drag.moved;
    this.drag = null;
    if (moved) return;
    this.pinned = !this.pinned;
    this.setProbe(this.pixelAt(event, canvas));
  }

  moveProbe(step) {
    const { width, height } = this.pixels;
    const [column, row] = this.probe || [Math.floor(width / 2), Math.floor(height / 2)];
    this.pinned = true;
    const place = [column + step[0], row + step[1]];
    this.setProbe([Math.min(width - 1, Math.max(0, place[0])), Math.min(height - 1, Math.max(0, place[1]))]);
  }

  setProbe(place) {
    this.probe = place;
    this.describe();
    this.draw();
  }

  describe() {
    const write = (name, text) => (this.live.querySelector(`[data-probe=${name}]`).textContent = text);
    const names = ["ours", "reference", "difference", "noise", "oursLux", "referenceLux"];
    if (!this.probe) {
      write("pixel", "–");
      write("surface", "point at a picture");
      for (const name of names) write(name, "–");
      return;
    }
    const { pixels } = this;
    const index = this.probe[1] * pixels.width + this.probe[0];
    write("pixel", `${this.probe[0]}, ${this.probe[1]}`);
    write("surface", pixels.surfaceNames[pixels.surface[index]].replaceAll("_", " "));
    write("ours", withUnit(pixels.ours.luminance[index], "cd/m²"));
    write("reference", withUnit(pixels.reference.luminance[index], "cd/m²"));
    write("difference", signedPercent(pixels.difference[index]));
    const noise = pixels.noise[index];
    write("noise", Number.isFinite(noise) ? noise.toFixed(1) + THIN_SPACE + "%" : "n/a");
    write("oursLux", withUnit(pixels.ours.illuminance[index], "lx"));
    write("referenceLux", withUnit(pixels.reference.illuminance[index], "lx"));
  }

  // A picture in the mode of the left pane, or a map; made when first asked for.
  source(name, whose) {
    const key = `${name} ${whose}`;
    if (!this.sources[key]) {
      const { width, height } = this.pixels;
      const values = whose ? this.pixels[whose][name] : this.pixels[name];
      if (name === "picture") this.sources[key] = this.pictures[whose === "ours" ? 0 : 1];
      else this.sources[key] = falseColour(values, width, height, this.pixels.scales[name]);
    }
    return this.sources[key];
  }

  resize() {
    const ratio = window.devicePixelRatio || 1;
    for (const canvas of Object.values(this.canvases)) {
      canvas.width = Math.round(canvas.clientWidth * ratio);
      canvas.height = Math.round((canvas.width * this.pixels.height) / this.pixels.width);
    }
    this.draw();
  }

  draw() {
    const share = Number(this.slider.value);
    const [left, right] = [this.canvases.left, this.canvases.right];
    this.paint(left, this.source(this.left, "reference"), 0, left.width);
    const edge = Math.round((share / 100) * left.width);
    if (edge > 0) this.paint(left, this.source(this.left, "ours"), 0, edge);
    this.paint(right, this.source(this.right, ""), 0, right.width);
    const context = left.getContext("2d");
    if (share > 0 && share < 100) {
      context.fillStyle = "#fff";
      context.fillRect(edge - 1.5, 0, 3, left.height);
      context.fillStyle = "#111";
      context.fillRect(edge - 0.5, 0, 1, left.height);
    }
    for (const canvas of [left, right]) this.cross(canvas);
    const stage = left.closest(".stage");
    stage.querySelector(".tag-left").hidden = share < 12;
    stage.querySelector(".tag-right").hidden = share > 88;
    this.slider.setAttribute("aria-valuetext", `${share} % Transom, ${100 - share} % Mitsuba 3`);
    this.live.querySelector("[data-zoom=level]").textContent = `${ZOOMS[this.zoom]}×`;
  }

  // The window of a source into the columns from `from` to `to` of a canvas.
  paint(canvas, source, from, to) {
    const context = canvas.getContext("2d");
    const [x, y, w, h] = this.window();
    context.imageSmoothingEnabled = false;
    context.save();
    context.beginPath();
    context.rect(from, 0, to - from, canvas.height);
    context.clip();
    context.drawImage(source, x, y, w, h, 0, 0, canvas.width, canvas.height);
    context.restore();
  }

  cross(canvas) {
    if (!this.probe) return;
    const context = canvas.getContext("2d");
    const [x, y, w, h] = this.window();
    const [sx, sy] = [canvas.width / w, canvas.height / h];
    const box = [(this.probe[0] - x) * sx, (this.probe[1] - y) * sy, Math.max(sx, 5), Math.max(sy, 5)];
    for (const [colour, width] of [["#fff", 4], ["#111", 2]]) {
      context.strokeStyle = colour;
      context.lineWidth = width;
      context.strokeRect(...box);
    }
  }
}

// Viewers are decoded when they come near the window: a page has many.
const viewers = new Map();
const nearness = new IntersectionObserver(
  (entries) => {
    for (const entry of entries) {
      if (!entry.isIntersecting || viewers.has(entry.target)) continue;
      const viewer = new Viewer(entry.target);
      viewers.set(entry.target, viewer);
      viewer.start();
    }
  },
  { rootMargin: "1200px 0px" },
);
for (const root of document.querySelectorAll(".viewer")) nearness.observe(root);

// Without focus in a viewer or a field, keys go to the viewer under the pointer.
document.addEventListener("keydown", (event) => {
  if (event.target !== document.body && !event.target.matches?.("a, summary, .scroll")) return;
  const hovered = document.querySelector(".viewer:hover");
  if (hovered && viewers.has(hovered)) viewers.get(hovered).key(event);
});
