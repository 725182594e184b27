"use strict";
// The paper's Figure 3, to be moved: rays through a prismatic panel, and where they go.

const SVG = "http://www.w3.org/2000/svg";
const DRAWN_RAYS = 7;
const LEAST_SHARE = 0.01; // Of the incident light: an exit that is printed.
const FRAME = { left: -1.6, right: 3.4, low: -1.5, high: 2.3 }; // In pitches.

for (const root of document.querySelectorAll(".prism")) {
  const product = JSON.parse(root.querySelector(".prism-data").textContent);
  const drawing = root.querySelector("svg");
  const inputs = Object.fromEntries([...root.querySelectorAll("input[type=range]")].map((input) => [input.name, input]));
  const sun = root.querySelector("select[name=sun]");

  const place = ([y, z]) => [(z - FRAME.left) * 100, (FRAME.high - y) * 100];
  const percent = (share) => `${(100 * share).toFixed(1)} %`;
  const degrees = (angle) => `${Math.abs(angle).toFixed(1)}° ${angle >= 0 ? "up" : "down"}`;

  const add = (name, attributes) => {
    const element = document.createElementNS(SVG, name);
    for (const [key, value] of Object.entries(attributes)) element.setAttribute(key, value);
    drawing.append(element);
  };

  const draw = (section, light) => {
    drawing.replaceChildren();
    const outline = [];
    for (let cell = -4; cell < 5; cell += 1) outline.push(...section.corners.slice(0, 2).map(([y, z]) => [y + cell, z]));
    outline.push([5, section.bottom], [5, 0], [-4, 0]);
    add("polygon", { points: outline.map((point) => place(point).map((v) => v.toFixed(1)).join()).join(" "), class: "panel" });
    for (const path of light.paths.filter((entry) => entry.share > LEAST_SHARE)) {
      const far = path.to || [path.from[0] + 9 * path.dy, path.from[1] + 9 * path.dz];
      const [[x1, y1], [x2, y2]] = [place(path.from), place(far)];
      const leaves = !path.to && path.dz > 0;
      const kind = leaves ? (path.dy > 0 ? "upwards" : "downwards") : "within";
      add("line", { x1, y1, x2, y2, class: kind, "stroke-opacity": Math.min(1, 0.12 + 0.88 * path.share).toFixed(3) });
    }
  };

  const update = () => {
    const values = Object.fromEntries(Object.entries(inputs).map(([name, input]) => [name, Number(input.value)]));
    for (const [name, input] of Object.entries(inputs)) {
      root.querySelector(`output[name=${name}]`).textContent = `${values[name]}°`;
      input.setAttribute("aria-valuetext", `${values[name]} degrees`);
    }
    const section = prismSection({ ...product, angle_low: values.angle_low, angle_high: values.angle_high });
    const light = tracePrism(section, values.profile, 400, DRAWN_RAYS);
    draw(section, light);
    const printed = light.exits.filter((exit) => exit.share >= LEAST_SHARE);
    root.querySelector("tbody").replaceChildren(
      ...printed.map((exit) => {
        const row = document.createElement("tr");
        for (const text of [degrees(exit.angle), percent(exit.share)]) {
          const cell = document.createElement("td");
          cell.textContent = text;
          row.append(cell);
        }
        return row;
      }),
    );
    const up = light.transmitted.filter((exit) => exit.angle > 0).reduce((sum, exit) => sum + exit.share, 0);
    const sent = light.transmitted.reduce((sum, exit) => sum + exit.share, 0);
    root.querySelector(".prism-totals").textContent =
      `Transmitted ${percent(sent)}, of it upwards ${percent(sent > 0 ? up / sent : 0)}; ` +
      `reflected ${percent(light.reflected)}; absorbed ${percent(light.absorbed)}.`;
    root.dataset.exits = JSON.stringify(light.exits);
    root.dataset.reflected = light.reflected;
  };

  for (const input of Object.values(inputs)) {
    input.addEventListener("input", () => {
      if (input.name === "profile") sun.value = "";
      update();
    });
  }
  sun.addEventListener("change", () => {
    if (sun.value !== "") inputs.profile.value = sun.value;
    update();
  });
  root.querySelector("[data-prism=reset]").addEventListener("click", () => {
    for (const input of Object.values(inputs)) input.value = input.defaultValue;
    sun.value = "";
    update();
  });
  root.querySelector(".prism-live").hidden = false;
  update();
}
