// The page of `view`: receives messages of the program, draws the newest, and acknowledges it.
// All values come from the program; the page computes only positions on the screen.
"use strict";
(() => {
  const byId = (id) => document.getElementById(id);
  const windows = [-3, -2, -1, 0, 1, 2, 3, 4].flatMap((k) => [1, 2, 5].map((n) => Number(n + "e" + k)));
  const usualWindow = 20; // s of wall time, of a machine without a period
  const usualPeriods = 30;
  const leastWindow = 2, mostWindow = 60; // s of wall time
  const longestPause = 5000; // ms between attempts to connect
  const silence = 6000; // ms without a message: the connection is dead
  const flash = 180; // ms for which an impact highlights its stop

  // For tests and for the browser's console.
  const sprag = (window.sprag = {
    connected: false, received: 0, scene: null, frame: null, curves: null, health: null, over: false, paused: false,
    view: { follow: true, window: 20, from: 0, to: 20, quantity: null },
  });

  const style = {};
  function readStyle() {
    const computed = getComputedStyle(document.documentElement);
    for (const name of ["paper", "panel", "ink", "muted", "edge", "grid", "estimate", "replica", "suspect", "lit", "closed"]) {
      style[name] = computed.getPropertyValue("--" + name).trim();
    }
    // The color of the estimate depends on the estimator.
    const named = document.documentElement.dataset.estimator;
    const own = { replica: "--replica", timing: "--timing", adaptive: "--adaptive" }[named] || "--both";
    style.estimate = computed.getPropertyValue(own).trim();
  }

  // ---- number formats ----
  function short(value) {
    if (value === null || value === undefined || !Number.isFinite(value)) return "–";
    if (value === 0) return "0";
    const size = Math.abs(value);
    if (size >= 1e5 || size < 1e-3) return value.toExponential(2).replace("+", "").replaceAll("-", "−");
    return value.toPrecision(4).replace("-", "−");
  }
  const count = (value) => String(value);
  function duration(seconds) {
    if (seconds >= 1) return short(seconds) + " s";
    return seconds >= 1e-3 ? (1e3 * seconds).toPrecision(3) + " ms" : (1e6 * seconds).toPrecision(3) + " µs";
  }
  function put(element, text, value) {
    if (element.textContent !== text) element.textContent = text;
    if (value !== undefined) element.dataset.value = value === null ? "" : String(value);
  }

  // ---- connection ----
  let socket = null;
  let pause = 500;
  let lastMessage = performance.now();
  let pending = null;
  let drawing = false;

  function state(name, text) {
    byId("connection").dataset.state = name;
    document.body.dataset.connection = name;
    put(byId("connection"), text);
    sprag.connected = name === "connected";
  }

  function connect() {
    lastMessage = performance.now();
    const mine = new WebSocket((location.protocol === "https:" ? "wss://" : "ws://") + location.host + "/stream");
    socket = mine;
    mine.onopen = () => {
      state("connected", "connected");
      pending = null;
      sendView();
    };
    mine.onmessage = (event) => {
      lastMessage = performance.now();
      pause = 500;
      pending = Object.assign(pending || {}, JSON.parse(event.data));
      sprag.received += 1;
      if (!drawing) {
        drawing = true;
        requestAnimationFrame(draw);
      }
    };
    mine.onclose = () => {
      if (socket !== mine) return;
      socket = null;
      state("lost", "not connected; trying again");
      setTimeout(connect, pause);
      pause = Math.min(2 * pause, longestPause);
    };
  }

  function send(message) {
    if (socket && socket.readyState === WebSocket.OPEN) socket.send(JSON.stringify(message));
  }

  setInterval(() => {
    if (document.hidden || drawing) lastMessage = performance.now();
    if (socket && performance.now() - lastMessage > silence) {
      const dead = socket;
      dead.close();
      if (dead.onclose) dead.onclose();
      dead.onclose = null;
    }
  }, 1000);

  // ---- selected window and quantity ----
  function plotPixels() {
    return Math.max(50, Math.round(curveChart ? curveChart.getArea().w : byId("curve-chart").clientWidth));
  }
  function sendView() {
    const view = sprag.view;
    const said = { pixels: plotPixels() };
    if (view.quantity) said.quantity = view.quantity;
    if (view.follow) said.window = view.window;
    else Object.assign(said, { from: view.from, to: view.to });
    send({ view: said });
  }
  // Until the user selects a length, the window spans some periods of the machine, in bounds of wall time. A recording
  // that is played faster than the machine went keeps the machine's bounds. `speed` null: as fast as possible.
  let chosen = false;
  function fitWindow(speed) {
    const pace = sprag.scene.replay ? Math.min(speed ?? 1, 1) : speed ?? 10;
    const { period } = sprag.scene;
    const wanted = period
      ? Math.min(Math.max(usualPeriods * period, leastWindow * pace), mostWindow * pace) : usualWindow * pace;
    const off = (length) => Math.abs(Math.log(length / wanted));
    const length = windows.reduce((best, each) => (off(each) < off(best) ? each : best));
    if (chosen || length === sprag.view.window) return;
    sprag.view.window = length;
    byId("window").value = String(length);
    if (sprag.view.follow) sendView();
  }
  function pressed(id, on) { byId(id).setAttribute("aria-pressed", String(on)); }
  function setPaused(paused) {
    sprag.paused = paused;
    pressed("pause", paused);
    put(byId("pause"), paused ? "Resume" : "Pause");
  }
  function follow(length) {
    sprag.view.follow = true;
    if (length) {
      chosen = true;
      sprag.view.window = length;
    }
    setPaused(false);
    pressed("follow", true);
    sendView();
  }
  function look(from, to) {
    if (!(from < to)) return;
    Object.assign(sprag.view, { follow: false, from, to });
    pressed("follow", false);
    sendView();
    applyWindow();
  }
  function move(shift, stretch) {
    const { from, to } = sprag.view;
    const middle = (from + to) / 2 + shift * (to - from);
    const half = stretch * (to - from) / 2;
    look(middle - half, middle + half);
  }

  // ---- the machine ----
  const machine = { canvas: byId("machine"), range: 0, middle: 0, events: [], litUntil: [] };

  function context(canvas) {
    const ratio = window.devicePixelRatio || 1;
    const width = canvas.clientWidth, height = canvas.clientHeight;
    if (canvas.width !== Math.round(width * ratio) || canvas.height !== Math.round(height * ratio)) {
      canvas.width = Math.round(width * ratio);
      canvas.height = Math.round(height * ratio);
    }
    const c = canvas.getContext("2d");
    c.setTransform(ratio, 0, 0, ratio, 0, 0);
    c.clearRect(0, 0, width, height);
    return { c, width, height };
  }

  function polyline(c, xs, ys) {
    c.beginPath();
    xs.forEach((x, i) => (i === 0 ? c.moveTo(x, ys[i]) : c.lineTo(x, ys[i])));
  }

  function lights(frame) {
    const now = performance.now();
    return frame.contacts.map((contact, i) => {
      if (machine.events[i] !== undefined && contact.events > machine.events[i]) machine.litUntil[i] = now + flash;
      machine.events[i] = contact.events;
      return contact.closed || now < (machine.litUntil[i] || 0);
    });
  }

  // Range of heights: it grows at once and shrinks slowly, so that the scale does not jump.
  function fitHeights(frame) {
    let low = frame.machine.base, high = frame.machine.base;
    const take = (y) => { if (y !== null) { low = Math.min(low, y); high = Math.max(high, y); } };
    (frame.machine.estimate || []).forEach(take);
    (frame.machine.truth || []).forEach(take);
    const reach = Math.max(high - frame.machine.base, frame.machine.base - low);
    // Distant stops are ignored: they would make the motion invisible.
    frame.contacts.forEach((contact) => {
      if (contact.y !== null && Math.abs(contact.y) < 8 * Math.max(reach, machine.range)) take(contact.y);
    });
    const needed = Math.max(Math.abs(low), Math.abs(high)) * 1.25 || 1e-12;
    machine.range = machine.range > needed && machine.range < 20 * needed
      ? Math.max(needed, machine.range * 0.997) : needed;
    return machine.range;
  }

  function drawStop(c, x, y, side, lit, size) {
    c.beginPath();
    c.moveTo(x, y);
    c.lineTo(x - 0.6 * size, y - side * size);
    c.lineTo(x + 0.6 * size, y - side * size);
    c.closePath();
    c.fillStyle = lit ? style.lit : style.panel;
    c.fill();
    c.lineWidth = lit ? 3 : 2;
    c.strokeStyle = style.ink;
    c.stroke();
  }

  function drawMachine(frame, lit) {
    const scene = sprag.scene;
    const { c, width, height } = context(machine.canvas);
    const range = fitHeights(frame);
    const beam = scene.machine === "beam";
    const places = scene.places;
    const left = beam ? 34 : 24, right = 24;
    const first = beam ? places[0] : 0.5;
    const last = beam ? places[places.length - 1] : places.length + 0.5;
    const X = (x) => left + ((x - first) / (last - first)) * (width - left - right);
    const Y = (y) => height / 2 - (y / range) * (height / 2 - 12);
    const shown = frame.machine;

    c.setLineDash([2, 4]);
    c.lineWidth = 1;
    c.strokeStyle = style.muted;
    polyline(c, [left, width - right], [Y(shown.base), Y(shown.base)]);
    c.stroke();
    c.setLineDash([]);
    if (beam) {
      const y = Y(shown.base);
      c.fillStyle = style.muted;
      c.fillRect(left - 12, y - 34, 12, 68);
    }

    const xs = places.map(X);
    const few = places.length <= 40;
    if (shown.estimate && shown.sigma) {
      const up = shown.estimate.map((y, i) => Y(y + 2 * shown.sigma[i]));
      const down = shown.estimate.map((y, i) => Y(y - 2 * shown.sigma[i]));
      c.globalAlpha = 0.28;
      c.fillStyle = c.strokeStyle = style.estimate;
      if (beam || !few) {
        polyline(c, xs.concat([...xs].reverse()), up.concat([...down].reverse()));
        c.fill();
      } else {
        const half = Math.min(16, (width - left - right) / places.length / 3);
        xs.forEach((x, i) => c.fillRect(x - half, up[i], 2 * half, down[i] - up[i]));
      }
      c.globalAlpha = 1;
    }
    const size = Math.min(26, height / 9);
    scene.stops.forEach((stop, i) => {
      const contact = frame.contacts[i];
      if (contact.y !== null) {
        drawStop(c, X(stop.across), Math.min(Math.max(Y(contact.y), -size), height + size), stop.side, lit[i], size);
      } else {
        const y = height - 12, from = X(stop.across), to = X(stop.other);
        c.strokeStyle = style.ink;
        c.lineWidth = lit[i] ? 5 : 2;
        polyline(c, [from, from, to, to], [y - 8, y, y, y - 8]);
        c.stroke();
        if (lit[i]) {
          c.fillStyle = style.lit;
          c.lineWidth = 2;
          c.fillRect((from + to) / 2 - 9, y - 9, 18, 18);
          c.strokeRect((from + to) / 2 - 9, y - 9, 18, 18);
        }
      }
    });

    if (shown.estimate) {
      c.strokeStyle = c.fillStyle = style.estimate;
      // The estimate penetrates a support, which the machine cannot do.
      if (frame.penetration > 0) c.globalAlpha = 0.4;
      const ys = shown.estimate.map(Y);
      c.lineWidth = beam ? 4 : 1.5;
      polyline(c, xs, ys);
      c.stroke();
      if (!beam && few) xs.forEach((x, i) => { c.beginPath(); c.arc(x, ys[i], 7, 0, 7); c.fill(); });
      c.globalAlpha = 1;
    }
    if (shown.truth) {
      c.strokeStyle = style.ink;
      c.lineWidth = 2;
      const ys = shown.truth.map(Y);
      if (beam || !few) {
        c.setLineDash([7, 5]);
        polyline(c, xs, ys);
        c.stroke();
        c.setLineDash([]);
      } else {
        xs.forEach((x, i) => { polyline(c, [x - 14, x + 14], [ys[i], ys[i]]); c.setLineDash([6, 3]); c.stroke(); c.setLineDash([]); });
      }
    }
    c.fillStyle = style.muted;
    c.font = "12px DejaVu Sans, Verdana, sans-serif";
    if (!beam && few) {
      c.textAlign = "center";
      xs.forEach((x, i) => c.fillText(scene.names[i], x, 14, (width - left - right) / places.length - 4));
    }
    c.textAlign = "right";
    c.fillText("± " + short(range), width - 4, height - 6);
  }

  // ---- curves ----
  let curveChart = null, energyChart = null, innovationChart = null, inputChart = null;
  let frozen = false; // new curves wait in `waiting`; set by pointerdown in a chart, cleared by pointerup or zoom
  let applying = false;

  function logTicks(low, high, pixels) {
    const from = Math.floor(Math.log10(low)), to = Math.ceil(Math.log10(high));
    const step = Math.max(1, Math.ceil((to - from) / Math.max(2, pixels / 34)));
    const ticks = [];
    for (let k = Math.ceil(from / step) * step; k <= to; k += step) ticks.push({ v: Math.pow(10, k), label: ("1e" + k).replace("-", "−") });
    return ticks;
  }

  function moved(from, to) {
    const view = sprag.view;
    const small = 1e-6 * (view.to - view.from);
    return Math.abs(from - view.from) > small || Math.abs(to - view.to) > small;
  }
  function userMoved(chart) {
    if (applying || frozen) return;
    const [from, to] = chart.xAxisRange();
    if (moved(from, to)) look(from, to);
  }

  // Fills the band as one path. dygraphs' plotter closes a path at each step, which costs quadratic time.
  function plotBand({ drawingContext: c, plotArea: area, points, color, setName }) {
    if (setName !== "estimate") return;
    const known = points.filter((point) => point.yval !== null);
    const y = (share) => area.y + share * area.h;
    c.beginPath();
    for (const point of known) c.lineTo(point.canvasx, y(point.y_top));
    for (const point of known.reverse()) c.lineTo(point.canvasx, y(point.y_bottom));
    c.closePath();
    c.save();
    c.globalAlpha = 0.25;
    c.fillStyle = color;
    c.fill();
    c.restore();
  }

  // Draws the guaranteed bounds of the machine's value; none where nothing is guaranteed.
  function drawGuaranteed(c, area, chart) {
    const curves = sprag.curves;
    if (!curves) return;
    const { t, low, high } = curves.guaranteed;
    c.save();
    c.beginPath();
    c.rect(area.x, area.y, area.w, area.h);
    c.clip();
    c.strokeStyle = style.replica;
    c.lineWidth = 1.6;
    c.setLineDash([2, 3]);
    for (const edge of [low, high]) {
      let pen = false;
      c.beginPath();
      edge.forEach((y, i) => {
        if (y === null) { pen = false; return; }
        const at = [chart.toDomXCoord(t[i]), chart.toDomYCoord(y)];
        if (pen) c.lineTo(...at);
        else c.moveTo(...at);
        pen = true;
      });
      c.stroke();
    }
    c.restore();
  }

  // Shades the background where the settled estimate penetrated a support.
  function shadePenetration(c, area, chart) {
    const curves = sprag.curves;
    if (!curves) return;
    c.save();
    c.globalAlpha = 0.22;
    c.fillStyle = style.suspect;
    for (let k = 0; k < curves.penetrating.length; k += 2) {
      const end = curves.penetrating[k + 1] === null ? curves.last : curves.penetrating[k + 1];
      const from = Math.max(area.x, chart.toDomXCoord(curves.penetrating[k]));
      const to = Math.min(area.x + area.w, chart.toDomXCoord(end));
      if (to > from) c.fillRect(from, area.y, to - from, area.h);
    }
    c.restore();
  }

  // Shades two sigma to either side of zero.
  function shadeTwoSigma(c, area, chart) {
    const top = Math.max(area.y, chart.toDomYCoord(2)), bottom = Math.min(area.y + area.h, chart.toDomYCoord(-2));
    c.save();
    c.globalAlpha = 0.25;
    c.fillStyle = style.estimate;
    c.fillRect(area.x, top, area.w, bottom - top);
    c.restore();
  }

  function makeCharts() {
    // dygraphs' legend sets inline styles, which the page's Content-Security-Policy forbids; the page has its own.
    Dygraph.PLUGINS = Dygraph.PLUGINS.filter((plugin) => plugin !== Dygraph.Plugins.Legend);
    const model = Object.assign({}, Dygraph.defaultInteractionModel, { dblclick: () => follow() });
    const common = {
      connectSeparatedPoints: true, interactionModel: model, animatedZooms: false,
      highlightCircleSize: 0, rightGap: 8, xRangePad: 0, drawGapEdgePoints: false,
      zoomCallback: (from, to) => { frozen = false; if (moved(from, to)) look(from, to); },
      drawCallback: (chart, initial) => { if (!initial) userMoved(chart); },
    };
    const axes = (more) => ({
      x: { axisLabelFormatter: (t) => String(Number(t.toPrecision(10))), pixelsPerLabel: 70 },
      y: Object.assign({ axisLabelWidth: 62, axisLabelFormatter: (y) => String(Number(y.toPrecision(3))).replace("-", "−") }, more),
    });
    curveChart = new Dygraph(byId("curve-chart"), [[0, [null, null, null], [null, null, null]]], Object.assign({
      labels: ["t", "estimate", "machine"], customBars: true, axes: axes({}), dateWindow: [0, 20],
      plotter: [plotBand, Dygraph.Plotters.linePlotter], underlayCallback: (...all) => { shadePenetration(...all); drawGuaranteed(...all); },
      series: { estimate: { strokeWidth: 2 }, machine: { strokeWidth: 1.6, strokePattern: [7, 4] } },
    }, common));
    energyChart = new Dygraph(byId("energy-chart"), [[0, null, null]], Object.assign({
      labels: ["t", "V", "B"], logscale: true, dateWindow: [0, 20],
      axes: axes({ ticker: (low, high, pixels) => logTicks(low, high, pixels) }), valueRange: [1e-3, 1],
      series: { V: { strokeWidth: 2 }, B: { strokeWidth: 1.6, strokePattern: [7, 4] } },
    }, common));
    innovationChart = new Dygraph(byId("innovation-chart"), [[0, null]], Object.assign({
      labels: ["t", "innovation"], axes: axes({}), dateWindow: [0, 20], valueRange: [-3, 3],
      drawPoints: true, pointSize: 2.5, strokeWidth: 0, underlayCallback: shadeTwoSigma,
    }, common));
    byId("innovation-part").hidden = true; // only now: a chart takes its size from its visible element
    if (sprag.scene.input) {
      byId("input-part").hidden = false;
      put(byId("input-title"), sprag.scene.input);
      inputChart = new Dygraph(byId("input-chart"), [[0, null]], Object.assign({
        labels: ["t", "input"], axes: axes({ pixelsPerLabel: 22 }), dateWindow: [0, 20], series: { input: { strokeWidth: 1.4 } },
      }, common));
    }
    for (const id of ["curve-chart", "input-chart", "energy-chart", "innovation-chart"]) {
      byId(id).addEventListener("pointerdown", () => { frozen = true; }, true);
    }
    for (const name of ["pointerup", "pointercancel"]) {
      window.addEventListener(name, () => setTimeout(() => {
        if (!frozen) return;
        frozen = false;
        charts().forEach(userMoved);
      }, 0), true);
    }
    recolour();
  }

  function charts() { return [curveChart, inputChart, energyChart, innovationChart].filter((chart) => chart); }

  function recolour() {
    readStyle();
    if (!curveChart) return;
    const common = { axisLineColor: style.muted, gridLineColor: style.grid };
    applying = true;
    curveChart.updateOptions(Object.assign({ colors: [style.estimate, style.ink] }, common), false);
    if (inputChart) inputChart.updateOptions(Object.assign({ colors: [style.ink] }, common), false);
    energyChart.updateOptions(Object.assign({ colors: [style.estimate, style.replica] }, common), false);
    innovationChart.updateOptions(Object.assign({ colors: [style.estimate] }, common), false);
    applying = false;
  }

  // Merges two lists of times into rows. rowOf gets the index in each list, -1 where a list lacks the time.
  function merged(a, b, rowOf) {
    const rows = [];
    let i = 0, j = 0;
    while (i < a.t.length || j < b.t.length) {
      const t = Math.min(i < a.t.length ? a.t[i] : Infinity, j < b.t.length ? b.t[j] : Infinity);
      const ofA = i < a.t.length && a.t[i] === t ? i++ : -1;
      const ofB = j < b.t.length && b.t[j] === t ? j++ : -1;
      rows.push(rowOf(t, ofA, ofB));
    }
    return rows;
  }

  function windowOf(curves) {
    const view = sprag.view;
    if (view.follow) Object.assign(view, { from: curves.from, to: curves.to });
    return [view.from, view.to];
  }

  function applyWindow() {
    if (!curveChart) return;
    applying = true;
    const dateWindow = [sprag.view.from, sprag.view.to];
    charts().forEach((chart) => chart.updateOptions({ dateWindow }));
    applying = false;
    if (sprag.curves) drawRaster(sprag.curves);
  }

  // Range of the values drawn. A band extends it by at most half the range of the curves.
  function heightsOf({ estimate, guaranteed, truth }) {
    let low = Infinity, high = -Infinity, lowest = Infinity, highest = -Infinity;
    const take = (y) => { if (y !== null) { low = Math.min(low, y); high = Math.max(high, y); } };
    estimate.mean.forEach(take);
    truth.value.forEach(take);
    if (low > high) return [-1, 1];
    for (const band of [estimate, guaranteed]) {
      band.low.forEach((y) => { if (y !== null) lowest = Math.min(lowest, y); });
      band.high.forEach((y) => { if (y !== null) highest = Math.max(highest, y); });
    }
    const room = high - low || Math.abs(high) || 1;
    const bottom = Math.max(Math.min(low, lowest), low - 0.5 * room);
    const top = Math.min(Math.max(high, highest), high + 0.5 * room);
    return [bottom - 0.06 * (top - bottom), top + 0.06 * (top - bottom)];
  }

  // A real machine publishes no true state, so nothing gives V. The innovations then show how good the estimate is.
  function showsInnovation(frame) { return frame.truth === null && frame.innovation !== null; }

  function choosePart(curves) {
    const innovations = showsInnovation(sprag.frame);
    const hide = (id, chart, hidden) => {
      if (byId(id).hidden === hidden) return;
      byId(id).hidden = hidden;
      if (!hidden) chart.resize();
    };
    hide("energy-part", energyChart, innovations && !curves.bound.B.some((B) => B !== null));
    hide("innovation-part", innovationChart, !innovations);
  }

  function drawCurves(curves) {
    const dateWindow = windowOf(curves);
    const nothing = [null, null, null];
    const { estimate, truth, energy, bound } = curves;
    const band = (i) => {
      const y = estimate.mean[i];
      return [estimate.low[i] === null ? y : estimate.low[i], y, estimate.high[i] === null ? y : estimate.high[i]];
    };
    let rows = merged(estimate, truth, (t, i, j) =>
      [t, i < 0 ? nothing : band(i), j < 0 ? nothing : [truth.value[j], truth.value[j], truth.value[j]]]);
    if (rows.length === 0) rows = [[dateWindow[0], nothing, nothing]];
    const heights = heightsOf(curves);
    const positive = (y) => (y > 0 ? y : null);
    let energies = merged(energy, bound, (t, i, j) =>
      [t, i < 0 ? null : positive(energy.V[i]), j < 0 ? null : positive(bound.B[j])]);
    let low = Infinity, high = 0;
    for (const [, V, B] of energies) {
      for (const y of [V, B]) if (y !== null) { low = Math.min(low, y); high = Math.max(high, y); }
    }
    if (energies.length === 0) energies = [[dateWindow[0], null, null]];
    const valueRange = high > 0 ? [low / 2, high * 3] : [1e-3, 1];
    applying = true;
    curveChart.updateOptions({ file: rows, dateWindow, valueRange: heights });
    choosePart(curves);
    energyChart.updateOptions({ file: energies, dateWindow, valueRange });
    const { t: closings, ratio } = curves.innovation;
    const reach = 1.1 * ratio.reduce((most, y) => Math.max(most, Math.abs(y)), 3 / 1.1);
    innovationChart.updateOptions({
      file: closings.length > 0 ? closings.map((at, i) => [at, ratio[i]]) : [[dateWindow[0], null]],
      dateWindow, valueRange: [-reach, reach],
    });
    if (inputChart) {
      const { t, value } = curves.input;
      const file = t.length > 0 ? t.map((at, i) => [at, value[i]]) : [[dateWindow[0], null]];
      inputChart.updateOptions({ file, dateWindow });
    }
    applying = false;
    drawRaster(curves);
    byId("guaranteed-legend").hidden = !curves.guaranteed.low.some((y) => y !== null);
    byId("inside-legend").hidden = curves.penetrating.length === 0;
    document.querySelectorAll('[data-of="truth"]').forEach((e) => { e.hidden = truth.t.length === 0 && energy.t.length === 0; });
    document.querySelector('[data-of="bound"]').hidden = !bound.B.some((B) => B !== null);
  }

  function drawRaster(curves) {
    const canvas = byId("raster");
    const contacts = curves.raster.length;
    const row = contacts > 20 ? 10 : 22;
    const height = 16 + row * contacts + "px";
    if (canvas.style.height !== height) canvas.style.height = height;
    const { c, width } = context(canvas);
    const area = curveChart.getArea();
    const { from, to } = sprag.view;
    const X = (t) => area.x + ((t - from) / (to - from)) * area.w;
    c.font = "12px DejaVu Sans, Verdana, sans-serif";
    c.textAlign = "right";
    c.textBaseline = "middle";
    curves.raster.forEach((closures, i) => {
      const y = 8 + row * i;
      c.fillStyle = style.ink;
      if (row > 10 || i % 5 === 0) c.fillText(String(i + 1), area.x - 6, y + row / 2);
      c.fillStyle = style.grid;
      c.fillRect(area.x, y + row - 1, area.w, 1);
      for (let k = 0; k < closures.length; k += 2) {
        const begin = Math.max(area.x, X(closures[k]));
        const end = Math.min(area.x + area.w, closures[k + 1] === null ? X(curves.last) : X(closures[k + 1]));
        if (end < area.x || begin > area.x + area.w) continue;
        if (end - begin > 2) {
          c.fillStyle = style.closed;
          c.fillRect(begin, y + 0.25 * row, end - begin, 0.5 * row);
        } else {
          c.fillStyle = style.ink;
          c.fillRect(begin - 0.75, y + 2, 1.5, row - 4);
        }
      }
    });
    for (const suspect of curves.suspects) {
      const x = X(suspect.t), y = 8 + row * (suspect.contact - 0.5), r = Math.min(7, row / 2);
      if (x < area.x || x > area.x + area.w) continue;
      c.fillStyle = style.suspect;
      c.strokeStyle = style.panel;
      c.lineWidth = 1;
      c.beginPath();
      c.moveTo(x, y - r); c.lineTo(x + r, y); c.lineTo(x, y + r); c.lineTo(x - r, y);
      c.closePath();
      c.fill();
      c.stroke();
    }
    c.strokeStyle = style.muted;
    c.strokeRect(area.x + 0.5, 8.5, Math.min(area.w, width - area.x - 1), row * contacts - 1);
  }

  // ---- texts and numbers ----
  const badges = { filter: "the filter's estimate", replica: "the replica's estimate", waiting: "waiting for an estimate" };

  function words(frame) {
    let text = badges[frame.badge];
    if (frame.badge === "free") text = "running free: no contact messages arrive (" + (frame.from_filter ? "filter" : "replica") + ")";
    if (frame.penetration > 0 && frame.badge !== "waiting") text += ", inside a support by " + short(frame.penetration) + " m";
    if (sprag.over) text = "the recording is over";
    put(byId("badge"), text);
    byId("badge").dataset.badge = frame.badge;
    const t = frame.machine.estimate || frame.machine.truth ? frame.machine.t : null;
    put(byId("t"), t === null ? "–" : t.toFixed(3) + " s", t);
    put(byId("V"), frame.energy ? short(frame.energy.V) : "no truth to compare with", frame.energy ? frame.energy.V : null);
    byId("V-row").hidden = showsInnovation(frame);
    byId("innovation-row").hidden = !showsInnovation(frame);
    if (frame.innovation) {
      put(byId("innovation"), short(frame.innovation.ratio) + ", contact " + frame.innovation.contact, frame.innovation.ratio);
    }
    put(byId("bound"), frame.bound === null ? "not known" : short(frame.bound), frame.bound);
    put(byId("suspect"), frame.suspect
      ? frame.suspect.suspicion + ", contact " + frame.suspect.contact + " at " + short(frame.suspect.t) + " s" : "none");
    const main = byId("sprag").dataset;
    main.session = frame.session || "";
    main.badge = frame.badge;
    main.penetration = frame.penetration;
    if (frame.settled) {
      main.tick = frame.settled.tick;
      main.t = frame.settled.t;
      main.q = JSON.stringify(frame.settled.q);
    }
    if (frame.energy) {
      main.v = frame.energy.V;
      main.vTick = frame.energy.k;
    }
    if (frame.estimator !== "unknown" && document.documentElement.dataset.estimator !== frame.estimator) {
      document.documentElement.dataset.estimator = frame.estimator;
      recolour();
    }
  }

  function drawContacts(frame, lit) {
    const list = byId("contacts");
    while (list.children.length < frame.contacts.length) list.append(document.createElement("li"));
    frame.contacts.forEach((contact, i) => {
      const item = list.children[i];
      const sigma = contact.sigma === null ? "" : " ± " + short(2 * contact.sigma);
      put(item, "g" + (i + 1) + " " + short(contact.gap) + sigma + (contact.closed ? ", closed" : "") + ", " + contact.events + " events");
      item.dataset.closed = contact.closed;
      item.dataset.lit = lit[i];
      item.dataset.events = contact.events;
    });
    const part = byId("parameters-part");
    part.hidden = frame.parameters.length === 0;
    if (!part.hidden) {
      fill(byId("parameters"), frame.parameters.map((p) =>
        ["parameter-" + p.key, p.key, short(p.value) + (p.sigma === null ? " (the scene's)" : " ± " + short(2 * p.sigma)), p.value, false]));
    }
  }

  // Fills a list of numbers. A row is [id, name, text, value, highlighted].
  function fill(list, rows) {
    const ids = rows.map((row) => row[0]).join(" ");
    if (list.dataset.ids !== ids) {
      list.dataset.ids = ids;
      list.replaceChildren(...rows.map(([id, name]) => {
        const row = document.createElement("div"), dt = document.createElement("dt"), dd = document.createElement("dd");
        dt.textContent = name;
        dd.id = id;
        row.append(dt, dd);
        return row;
      }));
    }
    rows.forEach(([, , text, value, notable], i) => {
      const dd = list.children[i].lastChild;
      put(dd, text, value);
      list.children[i].className = notable ? "notable" : "";
    });
  }

  function drawHealth(health) {
    const o = health.observer;
    if (!o) {
      put(byId("health-words"), "No observer reports its health" + (health.here.messages > 0 ? "; contact messages arrive." : ", and no contact messages arrive."));
      fill(byId("health"), [
        ["health-here-messages", "contact messages received here", count(health.here.messages), health.here.messages, false],
        ["health-here-lost", "of them lost on the way here", count(health.here.lost_messages), health.here.lost_messages, health.here.lost_messages > 0],
      ]);
      return;
    }
    const said = [];
    const lives = !o.last && o.age <= 3;
    if (o.last) said.push("The observer has ended.");
    else if (!lives) said.push("The last report of the observer arrived " + duration(o.age) + " ago.");
    if (lives) {
      said.push({ awaited: "The observer waits for a master.", heard: "The observer receives messages of its master.",
        silent: "The observer's master is silent; the estimate runs free.",
        ended: "The machine's run is over; the estimate runs free." }[o.master]);
    }
    if (lives && o.master === "heard" && o.speed !== null && o.speed > 0) {
      const pace = o.real_time_factor / o.speed;
      said.push(pace > 0.95 && pace < 1.05 ? "It keeps pace." : "It goes at " + short(pace) + " of the master's pace.");
    }
    if (lives && o.latencies > 0) said.push("An event is in the estimate " + duration(o.latency.p50) + " after it happened.");
    if (lives && o.input === "silent") said.push("No samples of the excitation arrive: the estimate holds the last one.");
    const troubles = (o.input === "silent" ? 1 : 0) + o.lost_events + o.skipped_events + o.inconsistencies + o.real_time_losses;
    said.push(troubles === 0 ? "Nothing is amiss." : "Marked numbers show faults.");
    put(byId("health-words"), said.join(" "));
    const rows = [];
    const add = (name, label, text, value, notable) => rows.push(["health-" + name, label, text, value, Boolean(notable)]);
    const counted = (name, label, amiss) => add(name.replaceAll("_", "-"), label, count(o[name]), o[name], amiss && o[name] > 0);
    add("real-time-factor", "real-time factor", short(o.real_time_factor) + (o.speed === null ? " (unpaced)" : " of " + short(o.speed)), o.real_time_factor);
    add("latency", "latency, half / 99 % / most", o.latencies > 0
      ? duration(o.latency.p50) + " / " + duration(o.latency.p99) + " / " + duration(o.latency.max) : "no events", o.latencies > 0 ? o.latency.p50 : null);
    add("lateness", "lateness of ticks", duration(o.lateness.p50) + " / " + duration(o.lateness.p99) + " / " + duration(o.lateness.max), o.lateness.p50);
    if (o.input !== "none") add("input", "excitation", o.input === "silent" ? "no samples" : "arrives", o.input, o.input === "silent");
    counted("ticks", "ticks settled");
    counted("missed_deadlines", "ticks that were late");
    counted("real_time_losses", "times real time was lost", true);
    counted("events", "events");
    counted("late_events", "of them reported after their tick (normal)");
    counted("rollbacks", "rollbacks for them (normal)");
    counted("lost_events", "lost events", true);
    counted("skipped_events", "impossible events", true);
    counted("inconsistencies", "inconsistencies", true);
    counted("messages", "messages");
    counted("lost_messages", "lost messages");
    add("reordered-messages", "doubled / reordered messages", o.doubled_messages + " / " + o.reordered_messages, o.reordered_messages);
    add("other-masters", "messages of others", count(o.other_masters), o.other_masters, o.other_masters > 0);
    const refused = Object.entries(o.refused);
    const sum = refused.reduce((all, [, n]) => all + n, 0);
    add("refused", "messages refused", sum === 0 ? "0" : refused.map(([cause, n]) => n + " " + cause.replaceAll("_", " ")).join(", "), sum, sum > 0);
    fill(byId("health"), rows);
  }

  function setScene(scene) {
    put(byId("scene"), scene.name + (scene.replay ? " (recording)" : ""));
    document.title = "Sprag: " + scene.name;
    const series = byId("series");
    series.replaceChildren(...scene.quantities.map((quantity) => new Option(quantity.label, quantity.name)));
    const known = scene.quantities.some((quantity) => quantity.name === sprag.view.quantity);
    if (!known) sprag.view.quantity = scene.quantities[0].name;
    series.value = sprag.view.quantity;
    machine.events = [];
    machine.range = 0;
    byId("machine").setAttribute("aria-label", scene.machine === "beam" ? "The beam in motion, with its stops" : "The coordinates in motion, with their stops");
    if (!curveChart) makeCharts();
    sendView();
  }

  let session = null;
  let waiting = null; // curves received while the user dragged

  function draw() {
    drawing = false;
    const message = pending;
    pending = null;
    if (!message) return;
    send({ seen: message.n });
    if (message.scene) {
      sprag.scene = message.scene;
      setScene(message.scene);
    }
    sprag.over = message.over;
    sprag.frame = message.frame;
    if (message.health) {
      sprag.health = message.health;
      drawHealth(message.health);
    }
    if (!sprag.scene) return;
    const faster = sprag.scene.replay ? sprag.scene.speed : 1;
    fitWindow(faster === null || message.frame.speed === null ? null : faster * message.frame.speed);
    if (message.frame.session !== session) {
      session = message.frame.session;
      machine.events = [];
      if (!sprag.view.follow) follow();
    }
    if (message.curves) waiting = message.curves;
    const lit = lights(message.frame);
    if (!sprag.paused) {
      words(message.frame);
      drawMachine(message.frame, lit);
      drawContacts(message.frame, lit);
    }
    if (waiting && !frozen) {
      sprag.curves = waiting;
      waiting = null;
      const chosen = sprag.scene.quantities.find((quantity) => quantity.name === sprag.curves.quantity);
      put(byId("curve-title"), chosen ? chosen.label : "");
      drawCurves(sprag.curves);
    }
  }

  // ---- controls ----
  byId("window").replaceChildren(...windows.map((length) => new Option(length + " s", String(length))));
  byId("window").value = "20";
  byId("window").addEventListener("change", () => follow(Number(byId("window").value)));
  byId("series").addEventListener("change", () => { sprag.view.quantity = byId("series").value; sendView(); });
  byId("follow").addEventListener("click", () => follow());
  byId("pause").addEventListener("click", () => {
    if (sprag.paused) { follow(); return; }
    look(sprag.view.from, sprag.view.to);
    setPaused(true);
  });
  byId("back").addEventListener("click", () => move(-0.5, 1));
  byId("forth").addEventListener("click", () => move(0.5, 1));
  byId("zoom-in").addEventListener("click", () => move(0, 0.5));
  byId("zoom-out").addEventListener("click", () => move(0, 2));
  matchMedia("(prefers-color-scheme: dark)").addEventListener("change", recolour);
  new ResizeObserver(() => { if (curveChart) sendView(); }).observe(byId("curve-chart"));
  readStyle();
  connect();
})();
