// The zoomable plots: one uPlot a panel, all of a run over the same stretch of time, with one cursor.
(() => {
  "use strict";
  const content = JSON.parse(document.getElementById("plots").textContent);
  const floats = (text) => new Float32Array(Uint8Array.from(atob(text), (c) => c.charCodeAt(0)).buffer);
  const colour = (name) => getComputedStyle(document.documentElement).getPropertyValue(`--${name}`).trim();
  const shown = (value) => (value == null ? "–" : Number(value.toPrecision(5)).toString());
  const dark = matchMedia("(prefers-color-scheme: dark)");
  const drawn = (window.pneucliPlots = {});

  // uPlot knows gaps as null only
  const values = (packed) => Array.from(floats(packed), (v) => (Number.isNaN(v) ? null : v));

  // a signal that was recorded more rarely than the others has samples without neighbours: no line, but dots
  const sparse = (numbers) => numbers.filter(Number.isNaN).length > numbers.length / 3;

  function series(panel) {
    let residuals = 0;
    return panel.series.map(({ label, role, values: packed }) => ({
      label,
      stroke: colour(role === "residual" ? `residual-${residuals++ % 5}` : role),
      dash: role === "before" ? [5, 4] : undefined,
      width: role === "measured" ? 3.5 : 1.25,
      spanGaps: false,
      points: { show: sparse(floats(packed)), size: 6 },
      value: (plot, v) => shown(v),
    }));
  }

  // a short tick at the upper edge wherever the model was set back to the measurement
  function restarts(plot, times) {
    const { ctx, bbox } = plot;
    ctx.save();
    ctx.strokeStyle = colour("faint");
    ctx.lineWidth = devicePixelRatio;
    for (const time of times) {
      const x = Math.round(plot.valToPos(time, "x", true));
      if (x < bbox.left || x > bbox.left + bbox.width) continue;
      ctx.beginPath();
      ctx.moveTo(x, bbox.top);
      ctx.lineTo(x, bbox.top + 7 * devicePixelRatio);
      ctx.stroke();
    }
    ctx.restore();
  }

  function options(panel, width, sync, zoomed) {
    const axis = { stroke: colour("faint"), grid: { stroke: colour("grid"), width: 1 }, ticks: { stroke: colour("grid") } };
    return {
      width,
      height: 150,
      cursor: { y: false, sync: { key: sync }, drag: { x: true, y: false }, points: { size: 6 } },
      scales: { x: { time: false } },
      series: [{ label: "t in s", value: (plot, v) => shown(v) }, ...series(panel)],
      axes: [
        { ...axis, size: 34 },
        { ...axis, size: 62, space: 24, values: (plot, ticks) => ticks.map(shown) },
      ],
      hooks: { setScale: [(plot, scale) => scale === "x" && zoomed(plot)], draw: [(plot) => restarts(plot, panel.restarts)] },
    };
  }

  function show(box, name, run) {
    const target = box.querySelector(".plots");
    (drawn[name] || []).forEach((plot) => plot.destroy());
    target.replaceChildren();
    let following = false;
    const plots = (drawn[name] = []);
    // a zoom by drag reaches the others through the shared cursor; one by any other way through here
    const zoomed = (source) => {
      if (following || plots.length < run.panels.length) return;
      following = true;
      const { min, max } = source.scales.x;
      plots.forEach((plot) => plot !== source && plot.setScale("x", { min, max }));
      following = false;
    };
    for (const panel of run.panels) {
      const title = document.createElement("h3");
      title.textContent = panel.unit ? `${panel.title} in ${panel.unit}` : panel.title;
      target.append(title);
      const time = Array.from(floats(panel.time), (t) => t + panel.start);
      const data = [time, ...panel.series.map((one) => values(one.values))];
      plots.push(new uPlot(options(panel, target.clientWidth, name, zoomed), data, target));
    }
  }

  // a folded chapter opens when a link leads to it
  const unfold = () => document.querySelector(`${location.hash || "#none"} > details`)?.setAttribute("open", "");
  addEventListener("hashchange", unfold);
  unfold();

  for (const box of document.querySelectorAll(".zoom")) {
    const name = box.dataset.plots;
    const runs = content[name];
    const choice = box.querySelector("select");
    runs.forEach((run, i) => choice.add(new Option(run.name, i)));
    const again = () => show(box, name, runs[choice.value]);
    choice.addEventListener("change", again);
    dark.addEventListener("change", again);
    let width = 0;
    new ResizeObserver(([entry]) => {
      const now = Math.floor(entry.contentRect.width);
      if (now === width) return;
      width = now;
      (drawn[name] || []).forEach((plot) => plot.setSize({ width, height: plot.height }));
    }).observe(box);
    again();
  }
})();
