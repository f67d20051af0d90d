// The filter: hides data sets and methods everywhere; its state stands in the address.
const form = document.getElementById("filters");
const [kinds, methodBoxes] = ["kind", "method"].map((name) => [...form.querySelectorAll(`[name=${name}]`)]);
const kindOf = Object.fromEntries(methodBoxes.map((box) => [box.value, box.dataset.kind]));

function applyFilter() {
  const scenario = form.elements.scenario.value;
  const open = new Set(kinds.filter((box) => box.checked).map((box) => box.value));
  const chosen = new Set(methodBoxes.filter((box) => box.checked && open.has(box.dataset.kind)).map((box) => box.value));
  isShown = (method) => !(method in kindOf) || chosen.has(method);
  const gone = methodBoxes.filter((box) => !isShown(box.value)).map((box) => box.parentElement.textContent.trim());
  isNameShown = (name) => !gone.some((method) => name === method || name.startsWith(`${method}, `));
  for (const one of document.querySelectorAll("main [data-scenario], main [data-method]")) {
    const {scenario: its, method} = one.dataset;
    one.classList.toggle("filtered", Boolean((scenario && its && its !== scenario) || (method && !isShown(method))));
  }
  markEmpty();
  for (const row of document.querySelectorAll(".choice > .buttons")) switchPanel(row);
  document.querySelectorAll(".plot").forEach(redraw);
  document.querySelectorAll(".grid:not(.two)").forEach((grid) => grid.classList.toggle("one", scenario !== ""));
  const all = methodBoxes.length;
  document.getElementById("filtered").textContent = `${chosen.size} of ${all} methods, ${scenario ? "1 data set" : "all data sets"}`;
  writeAddress();
}

function markEmpty() {  // says so where the filter left nothing
  for (const section of document.querySelectorAll("main section")) {
    const blocks = [...section.querySelectorAll(".block")];
    section.classList.toggle("empty", blocks.length > 0 && blocks.every((one) => one.classList.contains("filtered")));
  }
  for (const table of document.querySelectorAll("table")) {
    const rows = [...table.tBodies[0].rows];
    table.parentElement.classList.toggle("empty", rows.every((row) => row.classList.contains("filtered")));
  }
}

function switchPanel(row) {  // the panel in front is one that the filter shows
  const buttons = [...row.querySelectorAll("button[data-panel]")];
  const pressed = buttons.find((button) => button.getAttribute("aria-pressed") === "true");
  if (!pressed || !pressed.classList.contains("filtered")) return;
  const other = buttons.find((button) => !button.classList.contains("filtered"));
  if (other) other.click();
}

function writeAddress() {
  const state = new URLSearchParams();
  if (form.elements.scenario.value) state.set("scenario", form.elements.scenario.value);
  for (const [name, boxes] of [["kinds", kinds], ["methods", methodBoxes]]) {
    if (boxes.some((box) => !box.checked)) state.set(name, boxes.filter((box) => box.checked).map((box) => box.value).join(","));
  }
  const section = location.hash.slice(1).split("?")[0], text = decodeURIComponent(state.toString());
  const hash = section || text ? `#${section}${text ? `?${text}` : ""}` : " ";
  if (hash !== location.hash) history.replaceState(null, "", hash === " " ? location.href.split("#")[0] : hash);
}

function readAddress() {
  const state = new URLSearchParams(location.hash.split("?")[1] || "");
  form.elements.scenario.value = state.get("scenario") || "";
  if (form.elements.scenario.selectedIndex < 0) form.elements.scenario.value = "";
  for (const [name, boxes] of [["kinds", kinds], ["methods", methodBoxes]]) {
    const given = state.has(name) ? new Set(state.get(name).split(",")) : null;
    for (const box of boxes) box.checked = !given || given.has(box.value);
  }
}

form.addEventListener("submit", (event) => event.preventDefault());
form.addEventListener("change", applyFilter);
document.getElementById("show-all").addEventListener("click", () => {
  form.reset();
  applyFilter();
});
const list = form.querySelector("details");
document.addEventListener("click", (event) => {
  if (!list.contains(event.target)) list.open = false;
  const link = event.target.closest("a[href^='#']");
  if (link) reveal(document.getElementById(link.hash.slice(1)));
});
document.addEventListener("keydown", (event) => {
  if (event.key === "Escape") list.open = false;
});
addEventListener("hashchange", () => {  // a link within the page keeps the filter
  if (!location.hash.includes("?")) { writeAddress(); return; }
  readAddress();
  applyFilter();
  goToSection();
});

function reveal(element) {  // opens what it is folded into
  for (let fold = element; fold; fold = fold.parentElement) if (fold.tagName === "DETAILS") fold.open = true;
}

function goToSection() {  // the browser finds no section by an address that has a filter in it
  const section = document.getElementById(location.hash.slice(1).split("?")[0]);
  reveal(section);
  if (section && location.hash.includes("?")) section.scrollIntoView();
}

readAddress();
applyFilter();
goToSection();
