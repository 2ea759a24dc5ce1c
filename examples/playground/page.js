// Joins the sliders, the module and the picture. Every run is one call of the module; what it returns
// is read from its memory.
"use strict";

const element = (id) => document.getElementById(id);
const colour = (name) => getComputedStyle(document.documentElement).getPropertyValue(name);
const points = 1200;
const eventFields = 6;
const pathColumns = 3;

let library;
let values = [];
let run = null;

const system = () => systems[element("system").selectedIndex];

// A slider's position: masses are spread by their logarithms.
const isLogarithmic = (of) => (system().logarithmic || []).includes(of.name);
const position = (of, value) => (isLogarithmic(of) ? Math.log10(value) : value);
const value = (of, place) => (isLogarithmic(of) ? Math.round(10 ** place) : place);

function showSliders() {
  const rows = system().sliders.map((of, i) => {
    const label = document.createElement("label");
    const input = document.createElement("input");
    const output = document.createElement("output");
    Object.assign(input, { type: "range", min: position(of, of.min), max: position(of, of.max),
                           step: isLogarithmic(of) ? "any" : of.step, name: of.name });
    input.value = position(of, values[i]);
    const show = () => {
      output.textContent = `${values[i]} ${of.unit}`;
      input.setAttribute("aria-valuetext", output.textContent);
    };
    input.oninput = () => {
      values[i] = value(of, Number(input.value));
      show();
      update();
    };
    show();
    label.append(of.name, input, output);
    return label;
  });
  element("sliders").replaceChildren(...rows);
  element("text").textContent = system().text;
}

// Runs the system with its parameters; null and a message where these are refused.
function compute(number, parameters) {
  const start = performance.now();
  library.HEAPF64.set(parameters, library._play_parameters() / 8);
  const count = library._play_run(number, points);
  const time = performance.now() - start;
  const message = library.UTF8ToString(library._play_message());
  if (count < 0) return { message };
  const numbers = (address, size) => library.HEAPF64.slice(address / 8, address / 8 + size);
  const events = [];
  const all = numbers(library._play_events(), count * eventFields);
  for (let i = 0; i < count; ++i) {
    const [t, label, exact, at, before, after] = all.subarray(eventFields * i, eventFields * (i + 1));
    events.push({ t, label, exact, at, before, after });
  }
  const [total, steps] = numbers(library._play_counts(), 3);
  return { message, events, total, steps, time, path: numbers(library._play_path(), library._play_path_rows() * pathColumns) };
}

// A link that opens this system with these values.
function link() {
  const query = new URLSearchParams();
  query.set("system", system().key);
  system().sliders.forEach((of, i) => query.set(of.name.replace(/[ /]+/g, "-"), values[i]));
  return `#${query}`;
}

// Takes the system and its values from the address; what is missing or outside a slider is the first value.
function readLink() {
  const query = new URLSearchParams(location.hash.slice(1));
  const number = systems.findIndex((of) => of.key === query.get("system"));
  element("system").selectedIndex = Math.max(number, 0);
  values = system().sliders.map((of) => {
    const text = query.get(of.name.replace(/[ /]+/g, "-"));
    const given = Number(text);
    return text !== null && given >= of.min && given <= of.max ? given : of.value;
  });
}

function describe() {
  const status = element("status");
  status.classList.toggle("wrong", !run.events);
  if (!run.events) {
    status.textContent = run.message;
    return;
  }
  const off = run.events.map((event) => Math.abs(event.t - event.exact)).filter((difference) => difference >= 0);
  const worst = off.length ? `; farthest from the closed form ${Math.max(...off).toExponential(1)} s` : "";
  const found = run.total === 1 ? "1 event" : `${run.total} events`;
  const last = run.events[run.events.length - 1];
  const ending = last ? ` Last event: ${system().events[last.label]} at ${last.t.toPrecision(6)} s.` : "";
  status.textContent = `${found} in ${run.time.toFixed(1)} ms${worst}. How it ended: ${run.message}.${ending}`;
}

function fillTable() {
  const cell = (text) => Object.assign(document.createElement("td"), { textContent: text });
  const digits = (number, count) => (Number.isNaN(number) ? "-" : number.toPrecision(count));
  const rows = (run.events || []).map((event, i) => {
    const row = document.createElement("tr");
    const difference = event.t - event.exact;
    row.append(cell(i + 1), cell(system().events[event.label]), cell(digits(event.t, 16)), cell(digits(event.exact, 16)),
               cell(Number.isNaN(difference) ? "-" : difference.toExponential(1)),
               cell(digits(event.before, 7)), cell(digits(event.after, 7)));
    return row;
  });
  element("rows").replaceChildren(...rows);
  element("before").textContent = `${system().shown} before`;
  element("closed").textContent = `Closed form: ${system().closed}.`;
}

// A canvas, cleared, with its size in the units of the page.
function canvasOf(id) {
  const canvas = element(id);
  const ratio = window.devicePixelRatio || 1;
  const width = canvas.clientWidth;
  const height = canvas.clientHeight;
  canvas.width = width * ratio;
  canvas.height = height * ratio;
  const draw = canvas.getContext("2d");
  draw.scale(ratio, ratio);
  draw.font = "12px system-ui, sans-serif";
  draw.lineWidth = 1.5;
  return { draw, width, height };
}

const rowsOfPath = () => run.path.length / pathColumns;
const endOfPath = () => run.path[run.path.length - pathColumns];

// The frame of the plot: functions from time and value to the place in the canvas.
function axes({ draw, width, height }) {
  let low = Infinity;
  let high = -Infinity;
  for (let i = 0; i < run.path.length; ++i) {
    if (i % pathColumns === 0 || Number.isNaN(run.path[i])) continue;
    low = Math.min(low, run.path[i]);
    high = Math.max(high, run.path[i]);
  }
  for (const event of run.events) {
    low = Math.min(low, event.at);
    high = Math.max(high, event.at);
  }
  if (!(high > low)) high = low + 1;
  const end = endOfPath();
  const x = (t) => 48 + ((width - 60) * t) / end;
  const y = (v) => height - 24 - ((height - 40) * (v - low)) / (high - low);
  draw.fillStyle = colour("--faint");
  draw.strokeStyle = colour("--rule");
  draw.beginPath();
  for (const part of [0, 0.25, 0.5, 0.75, 1]) {
    const v = low + part * (high - low);
    draw.moveTo(48, y(v));
    draw.lineTo(width - 12, y(v));
    draw.textAlign = "right";
    draw.fillText(Math.abs(v) < 1e-9 * (high - low) ? "0" : v.toPrecision(3), 44, y(v) + 4);
    draw.textAlign = part === 1 ? "right" : "center";
    draw.fillText(`${Number((part * end).toPrecision(4))}${part === 1 ? " s" : ""}`, x(part * end) + (part === 1 ? 8 : 0), height - 6);
  }
  draw.stroke();
  return { x, y };
}

function drawPlot() {
  const canvas = canvasOf("plot");
  if (!run.events || run.path.length === 0) return;
  const { draw } = canvas;
  const { x, y } = axes(canvas);
  ["--other", "--line"].forEach((name, k) => {
    const column = 2 - k;
    draw.strokeStyle = colour(name);
    draw.beginPath();
    let event = 0;
    for (let i = 0; i < rowsOfPath(); ++i) {
      const row = pathColumns * i;
      // The corner at an event lies between two points of the path.
      for (; column === 1 && system().paths.length === 1 && event < run.events.length && run.events[event].t <= run.path[row]; ++event) {
        draw.lineTo(x(run.events[event].t), y(run.events[event].at));
      }
      if (!Number.isNaN(run.path[row + column])) draw.lineTo(x(run.path[row]), y(run.path[row + column]));
    }
    draw.stroke();
  });
  draw.fillStyle = colour("--mark");
  for (const event of run.events) {
    draw.beginPath();
    draw.arc(x(event.t), y(event.at), 3, 0, 7);
    draw.fill();
  }
  element("plot").setAttribute("aria-label", `${system().paths.join(" and ")} over time, with ${run.events.length} events`);
  element("legend").textContent = `${system().paths.map((name, k) => `${["blue", "yellow"][k]}: ${name}`).join("; ")}; dots: events.`;
}

function drawStage() {
  const canvas = canvasOf("stage");
  if (!run.events || run.path.length === 0) return;
  const t = Number(element("time").value) * endOfPath();
  const row = pathColumns * Math.min(Math.round((t / endOfPath()) * (rowsOfPath() - 1)), rowsOfPath() - 1);
  element("at").textContent = `${t.toFixed(2)} s`;
  const colours = { text: colour("--text"), line: colour("--line"), other: colour("--other"), faint: colour("--faint") };
  stages[system().key](canvas, { t, first: run.path[row + 1], second: run.path[row + 2], values, path: run.path, colours });
}

// The last instant of the discs follows from their parameters; the others have a slider for it.
const showPrograms = () => {
  for (const language of ["cpp", "python"]) {
    element(language).textContent = run.events ? system()[language](values, endOfPath()) : "";
  }
};

function update() {
  run = compute(element("system").selectedIndex, values);
  describe();
  fillTable();
  drawPlot();
  drawStage();
  showPrograms();
  history.replaceState(null, "", link());
}

function start() {
  showSliders();
  update();
}

let playing = 0;  // the request of the next frame
function play() {
  if (playing) {
    cancelAnimationFrame(playing);
    playing = 0;
    element("play").textContent = "Play";
    return;
  }
  const seconds = 10;
  const time = element("time");
  if (Number(time.value) >= 1) time.value = 0;
  const from = performance.now() - Number(time.value) * seconds * 1000;
  element("play").textContent = "Stop";
  const frame = (now) => {
    time.value = Math.min((now - from) / (seconds * 1000), 1);
    drawStage();
    playing = requestAnimationFrame(frame);
    if (Number(time.value) >= 1) play();
  };
  playing = requestAnimationFrame(frame);
}

async function copy(text, what) {
  try {
    await navigator.clipboard.writeText(text);
    element("copied").textContent = `${what} copied.`;
  } catch {
    element("copied").textContent = "The browser does not let this page copy; the text can be selected.";
  }
}

function connect() {
  element("system").replaceChildren(...systems.map((of) => new Option(of.title)));
  element("system").onchange = () => {
    values = system().sliders.map((of) => of.value);
    start();
  };
  element("time").oninput = drawStage;
  element("play").onclick = play;
  element("copy-link").onclick = () => copy(location.href, "Link");
  for (const button of document.querySelectorAll(".copy")) {
    button.onclick = () => copy(element(button.dataset.of).textContent, "Program");
  }
  window.onhashchange = () => {
    readLink();
    start();
  };
  window.onresize = () => {
    drawPlot();
    drawStage();
  };
}

ricochet().then((module) => {
  library = module;
  connect();
  readLink();
  start();
}, (error) => {
  element("status").textContent = `The module could not be loaded: ${error}. The page needs a web server, and a browser of 2022 or later.`;
});
