// Clouds to turn: the page holds each cloud once, and poses that move the source.
const SCENES = JSON.parse(document.getElementById("scenes").textContent);
const [BLUE, ORANGE, GREEN] = ["#0072b2", "#e69f00", "#009e73"];
const furnish = new Map();  // by plot, what puts the points into its figure

function cloud(name, color, scene, showlegend = true) {
  return {type: "scatter3d", mode: "markers", name, scene, showlegend, marker: {size: 2.2, color, opacity: 0.9}, hoverinfo: "name"};
}

function space(unit, from, to) {  // a view, from one share of the plot's width to another
  const axis = (name) => ({title: {text: `${name} [${unit}]`, font: {size: 11}}, tickfont: {size: 10}, nticks: 5, color: "#55616d", gridcolor: "#d5dbe1", backgroundcolor: "white", zeroline: false});
  const camera = {eye: {x: 1.3, y: 1.3, z: 0.85}, center: {x: 0, y: 0, z: -0.12}};
  return {xaxis: axis("x"), yaxis: axis("y"), zaxis: axis("z"), aspectmode: "data", camera, dragmode: "orbit", domain: {x: [from, to], y: [0, 1]}};
}

function setScene(plot, data, scenes) {
  const legend = {orientation: "h", x: 0, y: 1, yanchor: "bottom", itemsizing: "constant"};
  FIGURES[plot.id] = {data, layout: {height: 440, margin: {l: 0, r: 0, t: 30, b: 0}, legend, uirevision: "kept", ...scenes}};
}

function furnished(plot) {
  const figure = structuredClone(FIGURES[plot.id]);
  furnish.get(plot)().forEach(([x, y, z], index) => Object.assign(figure.data[index], {x, y, z}));
  return figure;
}

function refurnish(plot) {
  if (!plot.dataset.drawn) return;
  const clouds = furnish.get(plot)();
  const update = {x: clouds.map((cloud) => cloud[0]), y: clouds.map((cloud) => cloud[1]), z: clouds.map((cloud) => cloud[2])};
  Plotly.restyle(plot, update, clouds.map((_, index) => index));
}

function moved([x, y, z], pose) {
  return [0, 4, 8].map((at) => x.map((_, i) => pose[at] * x[i] + pose[at + 1] * y[i] + pose[at + 2] * z[i] + pose[at + 3]));
}

function turnTogether(plot) {  // the view that was not touched follows the one that was
  if (!FIGURES[plot.id].layout.scene2) return;
  let following = false;
  plot.on("plotly_relayouting", follow);
  plot.on("plotly_relayout", follow);
  function follow(change) {
    const from = Object.keys(change).find((key) => key.endsWith(".camera"));
    if (following || !from) return;
    following = true;
    const to = from === "scene.camera" ? "scene2.camera" : "scene.camera";
    Plotly.relayout(plot, {[to]: change[from]}).then(() => { following = false; });
  }
}

for (const card of document.querySelectorAll(".overlay")) {
  const scenario = card.dataset.scenario, choices = SCENES.examples[scenario], plot = card.querySelector(".plot"), {unit} = plot.dataset;
  let choice = "median", method = card.querySelector("[data-shows]").dataset.shows;
  const say = () => {
    const {pair, group, poses} = choices[choice];
    card.querySelector(".which").textContent = `${pair} (${group})`;
    card.querySelector(".says").textContent = poses[method].says;
  };
  setScene(plot, [
    cloud("source", BLUE, "scene"), cloud("target", ORANGE, "scene"),
    cloud("target", ORANGE, "scene2", false), cloud("source, registered", GREEN, "scene2"),
  ], {scene: space(unit, 0, 0.495), scene2: space(unit, 0.505, 1)});
  furnish.set(plot, () => {
    const {pair, poses} = choices[choice], {source, target} = SCENES.clouds[`${scenario}/${pair}`];
    return [source, target, target, moved(source, poses[method].pose)];
  });
  for (const button of card.querySelectorAll("button")) {
    button.addEventListener("click", () => {
      press(button);
      choice = button.dataset.choice || choice;
      method = button.dataset.shows || method;
      say();
      refurnish(plot);
    });
  }
  say();
}

for (const card of document.querySelectorAll(".walker")) {
  const scenario = card.dataset.scenario, walks = SCENES.walks[scenario], plot = card.querySelector(".plot");
  const [methods, pairs] = [".walk-method", ".walk-pair"].map((name) => card.querySelector(name));
  const slider = card.querySelector("input"), play = card.querySelector(".play");
  let walk = walks[0], timer = null;
  setScene(plot, [
    cloud("target", ORANGE, "scene"), cloud("source under the noisy pose G<sub>t</sub>", BLUE, "scene"),
    cloud("source under the prediction of G<sub>0</sub>", GREEN, "scene"),
  ], {scene: space(plot.dataset.unit, 0, 1)});

  const options = (select, entries) => select.replaceChildren(...entries.map(([value, text]) => new Option(text, value)));
  const off = (at) => `off by ${at.off[0]}° and ${at.off[1]} (${plot.dataset.unit})`;
  const show = () => {
    const step = Number(slider.value);
    card.querySelector(".walk-says").textContent = `Step ${step + 1} of ${walk.times.length}, t = ${walk.times[step]}: `
      + `prediction of G₀ ${off(walk.predicted[step])}; noisy pose ${off(walk.noisy[step])}`;
    refurnish(plot);
  };
  const stop = () => {
    clearInterval(timer);
    timer = null;
    play.textContent = "▶ Play";
  };
  const choose = () => {
    stop();
    walk = walks.find((one) => one.method === methods.value && one.pair === Number(pairs.value));
    slider.max = walk.times.length - 1;
    slider.value = 0;
    show();
    if (plot.dataset.drawn) Plotly.relayout(plot, ranges());
  };
  const listPairs = () => options(pairs, walks.filter((one) => one.method === methods.value).map((one) => [one.pair, `${one.pair} (${one.group})`]));
  const ranges = () => {  // wide enough for every step, so that nothing jumps but the cloud
    const {source, target} = SCENES.clouds[`${scenario}/${walk.pair}`];
    const all = [target, ...[...walk.noisy, ...walk.predicted].map((at) => moved(source, at.pose))];
    return Object.fromEntries(["x", "y", "z"].map((name, axis) => {
      const values = all.map((cloud) => cloud[axis]);
      const low = Math.min(...values.map((some) => Math.min(...some))), high = Math.max(...values.map((some) => Math.max(...some)));
      return [`scene.${name}axis.range`, [low, high]];
    }));
  };
  furnish.set(plot, () => {
    const step = Number(slider.value), {source, target} = SCENES.clouds[`${scenario}/${walk.pair}`];
    return [target, moved(source, walk.noisy[step].pose), moved(source, walk.predicted[step].pose)];
  });
  options(methods, [...new Map(walks.map((one) => [one.method, one.name]))]);
  listPairs();
  choose();
  for (const [name, range] of Object.entries(ranges())) FIGURES[plot.id].layout.scene[name.split(".")[1]].range = range;
  methods.addEventListener("change", () => { listPairs(); choose(); });
  pairs.addEventListener("change", choose);
  slider.addEventListener("input", () => { stop(); show(); });
  play.addEventListener("click", () => {
    if (timer !== null) { stop(); return; }
    if (slider.value === slider.max) slider.value = 0;
    play.textContent = "❚❚ Pause";
    show();
    timer = setInterval(() => {
      slider.value = Number(slider.value) + 1;
      show();
      if (slider.value === slider.max) stop();
    }, 700);
  });
}

for (const plot of document.querySelectorAll(".plot")) {
  reserve(plot);
  sight.observe(plot);
}
