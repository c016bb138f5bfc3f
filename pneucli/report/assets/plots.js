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
      legend: { live: true },
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

  // what a picture shows, for who cannot see it: each curve with its least and largest value
  function named(panel) {
    const told = panel.series.map(({ label, values: packed }) => {
      const known = floats(packed).filter((v) => !Number.isNaN(v));
      const [least, most] = known.reduce(([a, b], v) => [Math.min(a, v), Math.max(b, v)], [Infinity, -Infinity]);
      return known.length ? `${label} from ${shown(least)} to ${shown(most)}` : `${label}: nothing`;
    });
    return `${panel.title}${panel.unit ? ` in ${panel.unit}` : ""} over time: ${told.join(", ")}`;
  }

  // the stretch of time that is shown, and the whole; buttons, keys and fingers move it
  function stretch(plots) {
    const whole = plots.map((plot) => [plot.data[0][0], plot.data[0][plot.data[0].length - 1]]);
    const ends = [Math.min(...whole.map(([a]) => a)), Math.max(...whole.map(([, b]) => b))];
    const { min, max } = plots[0].scales.x;
    return { ends, now: [min ?? ends[0], max ?? ends[1]] };
  }

  function move(plots, how) {
    if (!plots.length) return;
    const { ends: [first, last], now: [min, max] } = stretch(plots);
    const width = max - min;
    const [centre, half] = { in: [0.5, 0.25], out: [0.5, 1], earlier: [0, 0.5], later: [1, 0.5], all: [0.5, Infinity] }[how];
    const wanted = Math.min(2 * half * width, last - first);
    const begin = Math.min(Math.max(min + centre * width - wanted / 2, first), last - wanted);
    plots.forEach((plot) => plot.setScale("x", { min: begin, max: begin + wanted }));
  }

  function tell(box, plots) {
    const { ends, now } = stretch(plots);
    const whole = now[0] <= ends[0] && now[1] >= ends[1];
    box.querySelector("[data-do=all]").disabled = whole;
    box.querySelector(".stretch").textContent = whole ? "" : `${shown(now[0])} to ${shown(now[1])} s of ${shown(ends[1])} s`;
  }

  const KEYS = { "+": "in", "=": "in", "-": "out", ArrowLeft: "earlier", ArrowRight: "later", 0: "all", Escape: "all", Home: "all" };

  // one finger drags over a stretch, two pinch; up and down scroll the page
  function touchable(plot, plots) {
    const held = new Map();
    let from = null;
    const place = (event) => event.clientX - plot.over.getBoundingClientRect().left;
    plot.over.addEventListener("pointerdown", (event) => {
      if (event.pointerType !== "touch") return;
      held.set(event.pointerId, place(event));
      const xs = [...held.values()];
      from = held.size === 1 ? { at: xs[0] } : { apart: Math.abs(xs[0] - xs[1]), min: plot.scales.x.min, max: plot.scales.x.max };
    });
    plot.over.addEventListener("pointermove", (event) => {
      if (!held.has(event.pointerId) || !from) return;
      held.set(event.pointerId, place(event));
      const xs = [...held.values()];
      if (held.size === 1 && from.at !== undefined) {
        plot.setSelect({ left: Math.min(from.at, xs[0]), width: Math.abs(xs[0] - from.at), top: 0, height: plot.over.clientHeight }, false);
      } else if (held.size === 2 && from.apart > 8) {
        const width = ((from.max - from.min) * from.apart) / Math.max(Math.abs(xs[0] - xs[1]), 8);
        const centre = (from.min + from.max) / 2;
        plots.forEach((one) => one.setScale("x", { min: centre - width / 2, max: centre + width / 2 }));
      }
    });
    const end = (event) => {
      if (!held.delete(event.pointerId)) return;
      const { left, width } = plot.select;
      if (event.type === "pointerup" && from?.at !== undefined && width > 8) {
        const [min, max] = [left, left + width].map((x) => plot.posToVal(x, "x"));
        plots.forEach((one) => one.setScale("x", { min, max }));
      }
      plot.setSelect({ left: 0, width: 0, top: 0, height: 0 }, false);
      if (!held.size) from = null;
    };
    for (const name of ["pointerup", "pointercancel"]) plot.over.addEventListener(name, end);
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
      tell(box, plots);
    };
    for (const panel of run.panels) {
      const title = document.createElement("h3");
      title.textContent = panel.unit ? `${panel.title} in ${panel.unit}` : panel.title;
      target.append(title);
      const time = Array.from(floats(panel.time), (t) => t + panel.start);
      const data = [time, ...panel.series.map((one) => values(one.values))];
      const plot = new uPlot(options(panel, target.clientWidth, name, zoomed), data, target);
      plot.ctx.canvas.setAttribute("role", "img");
      plot.ctx.canvas.setAttribute("aria-label", named(panel));
      plots.push(plot);
      touchable(plot, plots);
    }
    tell(box, plots);
  }

  // on paper every run stands as a small multiple of each panel; drawn when the page is printed
  function multiples(box, runs) {
    const target = box.querySelector(".multiples");
    target.replaceChildren();
    for (const run of runs) {
      const one = document.createElement("div");
      one.className = "one";
      const title = document.createElement("h3");
      title.textContent = run.name;
      one.append(title);
      for (const panel of run.panels) {
        if (panel.series.every(({ role }) => role === "input")) continue;
        const caption = document.createElement("p");
        caption.textContent = panel.unit ? `${panel.title} in ${panel.unit}` : panel.title;
        const time = Array.from(floats(panel.time), (t) => t + panel.start);
        const small = { show: true, size: 14, stroke: colour("faint"), font: "8px sans-serif", grid: { show: false }, ticks: { size: 2 }, gap: 1 };
        const made = new uPlot(
          {
            width: 240, height: 62, pxAlign: 0, legend: { show: false }, cursor: { show: false }, padding: [2, 2, 0, 0],
            scales: { x: { time: false } },
            series: [{}, ...series(panel).map((s) => ({ ...s, width: s.width / 2, points: { show: false } }))],
            axes: [{ ...small, space: 60 }, { ...small, size: 30, space: 22, values: (plot, ticks) => ticks.map(shown) }],
          },
          [time, ...panel.series.map((s) => values(s.values))],
        );
        drawn.printed.push(made);
        one.append(caption, made.ctx.canvas);
      }
      target.append(one);
    }
  }

  // of the folded tables in the chapters that are printed the short ones are printed, too
  function unfoldShort() {
    const folded = [...document.querySelectorAll("section details:not([open]):not(.chapter)")];
    const short = folded.filter((one) => one.querySelectorAll("tr").length <= SHORT && !one.closest("details.chapter:not([open])"));
    short.forEach((one) => one.setAttribute("open", ""));
    return short;
  }

  const SHORT = 27; // rows
  let opened = [];
  drawn.printed = [];
  addEventListener("beforeprint", () => {
    document.documentElement.dataset.printing = "";
    opened = [...document.querySelectorAll("details[data-printed]:not([open])")];
    opened.forEach((one) => one.setAttribute("open", ""));
    opened.push(...unfoldShort());
    for (const box of document.querySelectorAll(".zoom")) {
      if (!box.closest("details:not([open])")) multiples(box, content[box.dataset.plots]);
    }
  });
  addEventListener("afterprint", () => {
    delete document.documentElement.dataset.printing;
    opened.splice(0).forEach((one) => one.removeAttribute("open"));
    drawn.printed.splice(0).forEach((plot) => plot.destroy());
    document.querySelectorAll(".multiples").forEach((one) => one.replaceChildren());
  });

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
    const target = box.querySelector(".plots");
    target.tabIndex = 0;
    target.setAttribute("role", "group");
    target.setAttribute("aria-label", "time plots: + and − zoom, arrows move, 0 shows all");
    target.addEventListener("keydown", (event) => {
      const how = event.ctrlKey || event.metaKey || event.altKey ? undefined : KEYS[event.key];
      if (!how) return;
      event.preventDefault();
      move(drawn[name], how);
    });
    box.querySelectorAll("[data-do]").forEach((button) => button.addEventListener("click", () => move(drawn[name], button.dataset.do)));
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
