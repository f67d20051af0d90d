// Plots: drawn when they come into sight, and only what the filter lets through.
const FIGURES = JSON.parse(document.getElementById("figures").textContent);
const CONFIG = {displaylogo: false, responsive: true, modeBarButtonsToRemove: ["select2d", "lasso2d", "resetCameraLastSave3d", "tableRotation"]};
const sight = new IntersectionObserver((seen) => {
  for (const one of seen) if (one.isIntersecting) draw(one.target);
}, {rootMargin: "500px"});
let isShown = () => true;  // whether the filter lets a method through

function isHidden(element) {
  return element.closest("[hidden], .filtered") !== null;
}

function draw(plot) {
  if (plot.dataset.drawn || isHidden(plot)) return;
  plot.dataset.drawn = "yes";
  const figure = plot.classList.contains("turn") ? furnished(plot) : sifted(FIGURES[plot.id]);
  plot.style.minHeight = "";
  Plotly.newPlot(plot, figure.data, figure.layout, CONFIG).then(() => {
    if (plot.classList.contains("turn")) turnTogether(plot);
  });
}

function redraw(plot) {  // after the filter changed
  const figure = FIGURES[plot.id];
  if (!plot.dataset.drawn || plot.classList.contains("turn")) return;
  const {data, layout} = sifted(figure);
  if (isHidden(plot)) delete plot.dataset.drawn, Plotly.purge(plot);
  else Plotly.react(plot, data, layout, CONFIG).then(() => Plotly.Plots.resize(plot));
}

function sifted(figure) {  // the figure without the methods that the filter hides
  const data = figure.data.map(siftedTrace).filter((trace) => trace !== null);
  const layout = structuredClone(figure.layout);
  if (layout.meta) {
    const {categories: methods, line_height: height} = layout.meta;
    for (const axis of Object.keys(layout).filter((name) => name.startsWith("yaxis"))) {
      const kept = layout[axis].categoryarray.filter((_, index) => isShown(methods[index]));
      layout[axis].categoryarray = kept;
      layout[axis].range = [-0.6, kept.length - 0.4];
    }
    layout.height -= height * methods.filter((method) => !isShown(method)).length;
  }
  return {data, layout};
}

function siftedTrace(trace) {
  if (trace.meta && trace.meta.method) return isShown(trace.meta.method) ? structuredClone(trace) : null;
  if (!trace.customdata) return structuredClone(trace);
  const kept = trace.customdata.map(isShown);
  if (trace.customdata.length && !kept.some(Boolean)) return null;
  return pick(structuredClone(trace), kept);
}

function pick(value, kept) {  // every list with an entry a point keeps those of the points that stay
  if (Array.isArray(value)) return value.length === kept.length ? value.filter((_, index) => kept[index]) : value;
  if (value === null || typeof value !== "object") return value;
  return Object.fromEntries(Object.entries(value).map(([name, part]) => [name, pick(part, kept)]));
}

function press(button) {
  for (const other of button.parentElement.querySelectorAll("button")) other.setAttribute("aria-pressed", other === button);
}

for (const button of document.querySelectorAll("button[data-panel]")) {
  button.addEventListener("click", () => {
    press(button);
    for (const other of button.parentElement.children) document.getElementById(other.dataset.panel).hidden = other !== button;
    const panel = document.getElementById(button.dataset.panel);
    for (const plot of panel.querySelectorAll(".plot")) plot.dataset.drawn ? redraw(plot) : draw(plot);
  });
}

for (const plot of document.querySelectorAll(".plot")) {
  plot.style.minHeight = `${FIGURES[plot.id].layout.height}px`;  // so that a link to a section stays right
  sight.observe(plot);
}
