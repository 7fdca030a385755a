// The controls of the page.

const element = (id) => document.getElementById(id);
const data = JSON.parse(element("viewer-data").textContent);

// Colors that suit the background of the page.
function themeOf(canvas) {
  const [r, g, b] = getComputedStyle(canvas.parentElement).backgroundColor.match(/[\d.]+/g).map(Number);
  const isDark = r + g + b < 380;
  return { background: [r, g, b], outline: isDark ? [0.85, 0.88, 0.92, 0.75] : [0.2, 0.27, 0.31, 0.75] };
}

// Calls `draw` before the next frame is shown, once however often it is requested.
function onNextFrame(draw) {
  let isRequested = false;
  return () => {
    if (isRequested) return;
    isRequested = true;
    requestAnimationFrame(() => ((isRequested = false), draw()));
  };
}

function drawAxes(svg, camera) {
  const colors = ["#d55e00", "#009e73", "#3b8fd0"];
  const arms = [0, 1, 2].map((k) => ({ k, x: 26 * camera.right[k], y: -26 * camera.up[k], z: camera.toward[k] }));
  svg.innerHTML = arms.sort((a, b) => a.z - b.z).map(({ k, x, y }) =>
    `<line x2="${x.toFixed(1)}" y2="${y.toFixed(1)}" stroke="${colors[k]}" stroke-width="2"/>` +
    `<text x="${(1.35 * x).toFixed(1)}" y="${(1.35 * y + 4).toFixed(1)}" fill="${colors[k]}">${"xyz"[k]}</text>`).join("");
}

// Draws a bar of a round length.
function drawScale(bar, camera, height, { unit, factor }) {
  const pixels = height / 2 / camera.half / factor;
  const power = 10 ** Math.floor(Math.log10(90 / pixels));
  const length = [5, 2, 1].map((digit) => digit * power).find((length) => length * pixels <= 90) || power;
  bar.style.width = `${(length * pixels).toFixed(1)}px`;
  bar.textContent = `${+length.toPrecision(2)} ${unit}`;
}

function tooltip(tip, event, text) {
  tip.hidden = !text;
  if (!text) return;
  tip.textContent = text;
  const stage = tip.parentElement.getBoundingClientRect();
  const [x, y] = [event.clientX - stage.left, event.clientY - stage.top];
  tip.style.left = `${Math.max(0, Math.min(x + 14, stage.width - tip.offsetWidth - 4))}px`;
  tip.style.top = `${y + 18 + tip.offsetHeight > stage.height ? y - tip.offsetHeight - 10 : y + 18}px`;
}

// The networks follow the step of the body; returns a function that shows them at a pseudo-time.
function startNetworks() {
  const canvas = element("networks");
  const painter = data.networks.networks.length ? Painter.of(canvas) : null;
  if (!painter) return { setTime: () => {} };
  element("network-viewer").hidden = false;
  const networks = new Networks(painter, data.networks);
  const camera = new Camera(data.view, [0, 0, 0], 1);
  const reset = () => {
    const points = networks.allPoints();
    camera.radius = 1.05 * points.reduce((most, x) => Math.max(most, Math.abs(x)), 0.5) * Math.sqrt(3);
    camera.show(data.view);
    camera.fit(points, canvas.clientWidth / networks.sides.length / canvas.clientHeight);
  };
  const draw = onNextFrame(() => {
    networks.draw(camera, themeOf(canvas));
    drawAxes(element("network-axes"), camera);
    element("network-state").textContent = `t = ${digits(networks.shown.time)}`;
  });
  const choice = element("network");
  data.networks.networks.forEach(({ name }, k) => choice.add(new Option(name, k)));
  choice.addEventListener("change", () => (networks.setNetwork(+choice.value), networks.setTime(lastTime), reset(), draw()));
  control(canvas, camera, draw, reset);
  canvas.addEventListener("pointermove", (event) => {
    const box = canvas.getBoundingClientRect();
    const found = networks.fiberUnder(camera, event.clientX - box.left, event.clientY - box.top, box.width, box.height);
    tooltip(element("network-tip"), event, found && `fiber ${found.fiber}: stretch ${found.stretch.toFixed(3)}`);
  });
  canvas.addEventListener("pointerleave", (event) => tooltip(element("network-tip"), event, ""));
  new ResizeObserver(draw).observe(canvas);
  matchMedia("(prefers-color-scheme: dark)").addEventListener("change", draw);
  element("network-before").hidden = networks.sides.length < 2;
  const [low, high] = networks.range();
  element("network-bar").style.background = gradient(DIVERGING);
  // Two digits of the difference from 1; the bar reaches as far below 1 as above, where there may be no fiber.
  const text = (stretch) => stretch.toFixed(Math.min(7, Math.max(2, 1 - Math.floor(Math.log10(high - 1)))));
  element("network-low").textContent = low < 0 ? "" : text(low);
  element("network-high").textContent = text(high);
  element("network-note").textContent = `${data.networks.extremes.map(text).join(" to ")} in all steps; gray: 1`;
  let lastTime = Infinity;
  reset();
  draw();
  return { networks, camera, setTime: (time) => ((lastTime = time), networks.setTime(time), draw()) };
}

function startBody(networks) {
  const canvas = element("body");
  const painter = Painter.of(canvas);
  if (!painter) return null;
  element("body-viewer").hidden = false;
  const body = new Body(painter, data);
  const camera = new Camera(data.view, data.center, data.radius);
  const ranges = body.fields.map(({ range }) => [...range]);
  const [fieldChoice, slider, clipAxis, clipPlace] = ["field", "step", "clip", "clip-place"].map(element);
  const fit = () => camera.fit(joined(body.reference, body.current), canvas.clientWidth / canvas.clientHeight);
  const look = (show) => (show(), fit(), draw());
  const reset = () => (camera.show(data.view), fit());
  const draw = onNextFrame(() => {
    body.draw(camera, ranges[body.field], themeOf(canvas));
    drawAxes(element("body-axes"), camera);
    drawScale(element("scale"), camera, canvas.clientHeight, data.length);
    report.frames += 1;
  });

  const showField = () => {
    const field = body.fields[body.field];
    const [low, high] = ranges[body.field].map((x) => x * field.factor);
    element("bar-label").textContent = field.unit ? `${field.label} in ${field.unit}` : field.label;
    const text = field.of_elements ? String : digits;
    element("low").value = text(low);
    element("high").value = text(high);
    const [least, most] = field.extremes.map((x) => x * field.factor);
    const isCut = least < low - 1e-6 * (high - low) || most > high + 1e-6 * (high - low);
    const isTrimmed = isCut && ranges[body.field].every((end, k) => end === field.range[k]);
    element("bar-note").textContent = isCut
      ? `${isTrimmed ? "without the outermost 1 %; " : ""}all steps: ${text(least)} to ${text(most)} ${field.unit}`
      : "the same colors at all steps";
    draw();
  };
  body.fields.forEach(({ label }, k) => fieldChoice.add(new Option(label, k)));
  element("bar").style.background = gradient(VIRIDIS);
  const setField = (field) => ((fieldChoice.value = field), body.setField(field), showField());
  fieldChoice.addEventListener("change", () => setField(+fieldChoice.value));
  const setRange = () => {
    const { factor } = body.fields[body.field];
    const [low, high] = ["low", "high"].map((id) => parseFloat(element(id).value.replace(",", ".")) / factor);
    if (low < high) ranges[body.field] = [low, high];
    showField();
  };
  ["low", "high"].forEach((id) => element(id).addEventListener("change", setRange));
  element("range-reset").addEventListener("click", () => ((ranges[body.field] = [...body.fields[body.field].range]), showField()));

  const setStep = (step) => {
    slider.value = step;
    body.setStep(step);
    const { step: number, time } = data.steps[step];
    element("state").textContent = `${number === null ? "within a step" : `step ${number}`}, t = ${digits(time)}`;
    slider.setAttribute("aria-valuetext", element("state").textContent);
    networks.setTime(time);
    draw();
  };
  slider.max = data.steps.length - 1;
  slider.addEventListener("input", () => setStep(+slider.value));
  let timer = null;
  const stop = () => {
    clearInterval(timer);
    timer = null;
    element("play").textContent = "Play";
  };
  const advance = () => (body.step + 1 < data.steps.length ? setStep(body.step + 1) : stop());
  const play = () => {
    if (timer !== null) return stop();
    if (body.step === data.steps.length - 1) setStep(0);
    timer = setInterval(advance, 200);
    element("play").textContent = "Pause";
  };
  element("play").addEventListener("click", play);
  element("step-controls").hidden = data.steps.length < 2;

  const setClip = () => {
    const [axis, side] = [parseInt(clipAxis.value, 10), clipAxis.value.endsWith("-") ? -1 : 1];
    body.clip = { axis, side, place: clipPlace.value / 1000 };
    clipPlace.disabled = axis < 0;
    body.cutBody();
    draw();
  };
  clipAxis.addEventListener("change", setClip);
  clipPlace.addEventListener("input", setClip);
  for (const name of ["lines", "outline", "fibers"]) {
    element(`show-${name}`).addEventListener("change", (event) => ((body.shows[name] = event.target.checked), draw()));
  }
  element("fibers-label").hidden = !body.glyphs.length;
  element("view-home").addEventListener("click", () => look(() => camera.show(data.view)));
  ["x", "y", "z"].forEach((name, axis) => {
    const button = element(`view-${name}`);
    // A second click looks from the other side.
    button.addEventListener("click", () => look(() => camera.showAxis(axis, camera.toward[axis] > 0.999 ? -1 : 1)));
  });

  const describe = (x, y) => {
    const found = pointUnder(body, camera, x, y, canvas.clientWidth / canvas.clientHeight);
    if (!found) return "";
    const { label, unit, factor, of_elements: ofElements } = body.fields[body.field];
    const place = (p) => p.map((x) => digits(x * data.length.factor)).join(", ");
    const value = ofElements ? found.value : digits(found.value * factor);
    const lines = [`${label}: ${value} ${unit}`];
    if (!data.renumbered) lines.push(`element ${body.elements[found.element]}`);
    lines.push(`position ${place(found.point)} ${data.length.unit}`);
    if (found.displacement) lines.push(`displacement ${place(found.displacement)} ${data.length.unit}`);
    return lines.join("\n");
  };
  const point = onNextFrame(() => lastEvent && tooltip(element("body-tip"), lastEvent.event, describe(lastEvent.x, lastEvent.y)));
  let lastEvent = null;
  canvas.addEventListener("pointermove", (event) => {
    const box = canvas.getBoundingClientRect();
    const x = (2 * (event.clientX - box.left)) / box.width - 1;
    lastEvent = { event, x, y: 1 - (2 * (event.clientY - box.top)) / box.height };
    point();
  });
  canvas.addEventListener("pointerleave", (event) => ((lastEvent = null), tooltip(element("body-tip"), event, "")));
  control(canvas, camera, draw, reset, (key) => {
    const actions = {
      " ": play,
      "[": () => setStep(Math.max(body.step - 1, 0)),
      "]": () => setStep(Math.min(body.step + 1, data.steps.length - 1)),
      v: () => {
        const box = canvas.getBoundingClientRect();
        const event = { clientX: box.left + box.width / 2, clientY: box.top + box.height / 2 };
        tooltip(element("body-tip"), event, describe(0, 0) || "no body at the center of the picture");
      },
    };
    if (actions[key]) actions[key]();
    return key in actions;
  });
  new ResizeObserver(draw).observe(canvas);
  matchMedia("(prefers-color-scheme: dark)").addEventListener("change", draw);

  const report = { body, camera, networks, frames: 0, setField, setStep, describe };
  camera.show(data.view);
  // The canvas is as high as the body needs.
  const shape = camera.fit(joined(body.reference, body.current), 1);
  const height = Math.max(260, Math.min(0.92 * shape * canvas.clientWidth + 40, 620, 1.1 * canvas.clientWidth));
  canvas.style.height = `${Math.round(height)}px`;
  fit();
  setField(0);
  setStep(data.start);
  element("view-home").textContent = "Reset";
  return report;
}

// The address may name a step, a field and a clip: report.html#step=3&field=energy_density&clip=0,0.4
function fromAddress(report) {
  const wanted = new URLSearchParams(location.hash.slice(1));
  const step = data.steps.findIndex((step) => String(step.step) === wanted.get("step"));
  const field = report.body.fields.findIndex((field) => field.name === wanted.get("field"));
  if (step >= 0) report.setStep(step);
  if (field >= 0) report.setField(field);
  const [axis, place] = (wanted.get("clip") || "").split(",");
  if (axis) {
    element("clip").value = axis;
    element("clip-place").value = 1000 * place;
    element("clip").dispatchEvent(new Event("change"));
  }
}

let viewer = null;
try {
  viewer = startBody(startNetworks());
} catch (error) {
  console.error(error);
}
if (viewer) {
  fromAddress(viewer);
  window.addEventListener("hashchange", () => fromAddress(viewer));
  window.biotissue = viewer;
} else {
  // Without WebGL 2, the page shows the still picture, as it does without scripts.
  element("body-viewer").hidden = element("network-viewer").hidden = true;
  const still = element("still");
  still.outerHTML = still.textContent;
}
