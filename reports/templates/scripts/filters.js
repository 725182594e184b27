"use strict";
// Filters of the list of verdicts, by text, verdict and scene.

const filterForm = document.querySelector(".filters");
const verdictRows = [...document.querySelectorAll(".verdict-list tbody tr")].map((element) => {
  const [outcome, scene] = (element.dataset.tags || "|").split("|");
  return { element, outcome, scene, text: element.textContent.toLowerCase() };
});
const VISIBLE_AT_FIRST = 24;

function filterVerdicts(everything) {
  const words = filterForm.elements.text.value.toLowerCase().split(/\s+/).filter(Boolean);
  const [outcome, scene] = [filterForm.elements.outcome.value, filterForm.elements.scene.value];
  const isFiltered = words.length > 0 || outcome !== "" || scene !== "";
  let found = 0;
  let shown = 0;
  for (const row of verdictRows) {
    const fits =
      words.every((word) => row.text.includes(word)) &&
      (outcome === "" || row.outcome === outcome) &&
      (scene === "" || row.scene === scene);
    found += fits;
    const visible = fits && (isFiltered || everything || shown < VISIBLE_AT_FIRST);
    shown += visible;
    row.element.hidden = !visible;
  }
  const output = filterForm.querySelector(".filter-count");
  output.textContent = shown < found ? `${shown} of ${found} shown ` : `${found} of ${verdictRows.length}`;
  if (shown < found) {
    const button = document.createElement("button");
    button.type = "button";
    button.textContent = "Show all";
    button.addEventListener("click", () => filterVerdicts(true));
    output.append(button);
  }
}

for (const scene of [...new Set(verdictRows.map((row) => row.scene))].filter(Boolean).sort()) {
  filterForm.elements.scene.append(new Option(scene, scene));
}
filterForm.addEventListener("input", () => filterVerdicts(false));
filterForm.addEventListener("submit", (event) => event.preventDefault());
filterVerdicts(false);

// A link to a row that is filtered out shows it.
function revealTarget() {
  const target = document.getElementById(decodeURIComponent(location.hash.slice(1)));
  if (!target || !target.closest(".verdict-list")) return;
  filterForm.reset();
  filterVerdicts(true);
  target.scrollIntoView({ block: "center" });
}
window.addEventListener("hashchange", revealTarget);
revealTarget();
window.addEventListener("beforeprint", () => filterVerdicts(true));
