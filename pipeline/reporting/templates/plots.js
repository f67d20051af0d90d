// Plots: drawn when they come into sight, and only what the filter lets through.
const FIGURES = JSON.parse(document.getElementById("figures").textContent);
const CONFIG = {displaylogo: false, responsive: true, modeBarButtonsToRemove: ["select2d", "lasso2d", "resetCameraLastSave3d", "tableRotation"]};
const LINE_HEIGHT = 22;  // pixels of a category
const AXIS = {gridcolor: "#e4e8ec", linecolor: "#9aa5b1", zeroline: false, automargin: true, exponentformat: "none", tickfont: {size: 11}, title: {standoff: 6, font: {size: 12}}};
const LOOK = {layout: {
  font: {family: "system-ui, 'Segoe UI', Roboto, 'Helvetica Neue', sans-serif", size: 12, color: "#1d2733"},
  paper_bgcolor: "rgba(0,0,0,0)", plot_bgcolor: "white", margin: {l: 60, r: 16, t: 34, b: 50}, hovermode: "closest",
  legend: {font: {size: 11}, tracegroupgap: 0}, xaxis: AXIS, yaxis: AXIS,
}};
let isShown = () => true;  // whether the filter lets a method through
let isNameShown = () => true;  // the same of what stands beside a line, as in "FGR" or "CF, with diffusion"

const sight = new IntersectionObserver((seen) => {
  for (const one of seen) if (one.isIntersecting) draw(one.target);
}, {rootMargin: "500px"});

function isHidden(element) {
  return element.closest("[hidden], .filtered, details:not([open])") !== null;
}

function reserve(plot) {  // so that a link to a section stays right
  plot.style.minHeight = `${FIGURES[plot.id].layout.height}px`;
}

function draw(plot) {
  if (plot.dataset.drawn || isHidden(plot)) return;
  plot.dataset.drawn = "yes";
  plot.style.minHeight = "";
  const turns = plot.classList.contains("turn"), {data, layout} = turns ? furnished(plot) : sifted(FIGURES[plot.id]);
  Plotly.newPlot(plot, data, {...layout, template: LOOK}, CONFIG).then(() => turns && turnTogether(plot));
}

function redraw(plot) {  // after the filter changed
  if (!plot.dataset.drawn || plot.classList.contains("turn")) return;
  const {data, layout} = sifted(FIGURES[plot.id]);
  if (isHidden(plot)) {
    delete plot.dataset.drawn;
    Plotly.purge(plot);
    reserve(plot);
  } else Plotly.react(plot, data, {...layout, template: LOOK}, CONFIG).then(() => Plotly.Plots.resize(plot));
}

function sifted(figure) {  // the figure without the methods that the filter hides
  const data = structuredClone(figure.data.filter((trace) => isShown(trace.meta))), layout = structuredClone(figure.layout);
  const lines = Object.values(layout).filter((axis) => axis && axis.categoryarray);
  for (const axis of lines) {
    const kept = axis.categoryarray.filter((name) => isNameShown(name)), gone = axis.categoryarray.length - kept.length;
    Object.assign(axis, {categoryarray: kept, range: [-0.6, kept.length - 0.4]});
    if (axis === lines[0]) layout.height -= LINE_HEIGHT * gone;
  }
  return {data, layout};
}

function press(button) {
  for (const other of button.parentElement.querySelectorAll("button")) other.setAttribute("aria-pressed", other === button);
}

for (const button of document.querySelectorAll("button[data-panel]")) {
  button.addEventListener("click", () => {
    press(button);
    for (const other of button.parentElement.children) document.getElementById(other.dataset.panel).hidden = other !== button;
  });
}
