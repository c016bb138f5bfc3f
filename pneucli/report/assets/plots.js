// Time plots, for the report and the workbench: one uPlot a panel, all over the same interval of time, with one cursor.
// A panel is { title, unit, start, restarts, spans, time, series: [{ label, role, values }] }, its arrays Float32Array.
const TimePlots = (() => {
  "use strict";
  const colour = (name) => getComputedStyle(document.documentElement).getPropertyValue(`--${name}`).trim();
  const shown = (value) => (value == null ? "–" : Number(value.toPrecision(5)).toString());
  const titled = (panel) => (panel.unit ? `${panel.title} in ${panel.unit}` : panel.title);

  // uPlot knows gaps as null only
  const values = (numbers) => Array.from(numbers, (v) => (Number.isNaN(v) ? null : v));
  const data = (panel) => [Array.from(panel.time, (t) => t + panel.start), ...panel.series.map((one) => values(one.values))];

  // a signal that was recorded more rarely than the others has samples without neighbours: no line, but dots
  const sparse = (numbers) => {
    const known = numbers.filter((v) => !Number.isNaN(v)).length;
    const alone = numbers.filter((v, i) => !Number.isNaN(v) && [numbers[i - 1], numbers[i + 1]].every((w) => w === undefined || Number.isNaN(w)));
    return alone.length > known / 3;
  };

  function series(panel) {
    let residuals = 0;
    return panel.series.map(({ label, role, values: numbers }) => ({
      label,
      stroke: colour(role === "residual" ? `residual-${residuals++ % 5}` : role),
      dash: role === "before" ? [5, 4] : undefined,
      width: role === "measured" ? 3.5 : 1.25,
      spanGaps: false,
      points: { show: sparse(numbers), size: 6 },
      value: (plot, v) => shown(v),
    }));
  }

  // shaded intervals of time, below the curves
  function shade(plot, spans) {
    const { ctx, bbox } = plot;
    ctx.save();
    ctx.beginPath();
    ctx.rect(bbox.left, bbox.top, bbox.width, bbox.height);
    ctx.clip();
    ctx.fillStyle = colour("bad-ground");
    for (const [from, to] of spans || []) {
      const left = plot.valToPos(from, "x", true);
      ctx.fillRect(left, bbox.top, Math.max(plot.valToPos(to, "x", true) - left, devicePixelRatio), bbox.height);
    }
    ctx.restore();
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

  // what a picture shows, for who cannot see it: each curve with its least and largest value
  function named(panel) {
    const told = panel.series.map(({ label, values: numbers }) => {
      const known = numbers.filter((v) => !Number.isNaN(v));
      const [least, most] = known.reduce(([a, b], v) => [Math.min(a, v), Math.max(b, v)], [Infinity, -Infinity]);
      return known.length ? `${label} from ${shown(least)} to ${shown(most)}` : `${label}: nothing`;
    });
    return `${titled(panel)} over time: ${told.join(", ")}`;
  }

  const KEYS = { "+": "in", "=": "in", "-": "out", ArrowLeft: "earlier", ArrowRight: "later", 0: "all", Escape: "all", Home: "all" };

  // The plots in the element `box`, which has `.plots`, `.stretch` and buttons with `data-do`; `group` names their cursor.
  // `moved` is called with an interval that the user chose.
  class TimePlots {
    constructor(box, group, { height = 150, moved = () => {} } = {}) {
      Object.assign(this, { box, group, height, moved, plots: [], panels: [], ends: null, following: false, width: 0 });
      this.target = box.querySelector(".plots");
      this.target.tabIndex = 0;
      this.target.setAttribute("role", "group");
      this.target.setAttribute("aria-label", "time plots: + and − zoom, arrows move, 0 shows all");
      this.target.addEventListener("keydown", (event) => {
        const how = event.ctrlKey || event.metaKey || event.altKey ? undefined : KEYS[event.key];
        if (!how) return;
        event.preventDefault();
        this.move(how);
      });
      box.querySelectorAll("[data-do]").forEach((one) => one.addEventListener("click", () => this.move(one.dataset.do)));
      matchMedia("(prefers-color-scheme: dark)").addEventListener("change", () => this.show(this.panels, this.ends));
      new ResizeObserver(([entry]) => {
        const now = Math.floor(entry.contentRect.width);
        if (now === this.width) return;
        this.width = now;
        this.plots.forEach((plot) => plot.setSize({ width: this.target.clientWidth, height: this.height }));
      }).observe(box);
    }

    options(index, panel) {
      const axis = { stroke: colour("faint"), grid: { stroke: colour("grid"), width: 1 }, ticks: { stroke: colour("grid") } };
      const now = () => this.panels[index];
      return {
        width: this.target.clientWidth,
        height: this.height,
        legend: { live: true },
        cursor: { y: false, sync: { key: this.group }, drag: { x: true, y: false }, points: { size: 6 } },
        scales: { x: { time: false } },
        series: [{ label: "t in s", value: (plot, v) => shown(v) }, ...series(panel)],
        axes: [
          { ...axis, size: 34 },
          { ...axis, size: 62, space: 24, values: (plot, ticks) => ticks.map(shown) },
        ],
        hooks: {
          setScale: [(plot, scale) => scale === "x" && this.zoomed(plot)],
          drawClear: [(plot) => shade(plot, now().spans)],
          draw: [(plot) => restarts(plot, now().restarts)],
        },
      };
    }

    // draw panels anew; `ends` are those of the whole recording where the panels hold a part of it only
    show(panels, ends = null) {
      this.plots.splice(0).forEach((plot) => plot.destroy());
      this.target.replaceChildren();
      Object.assign(this, { panels, ends });
      panels.forEach((panel, index) => {
        const title = document.createElement("h3");
        title.textContent = titled(panel);
        this.target.append(title);
        const plot = new uPlot(this.options(index, panel), data(panel), this.target);
        plot.ctx.canvas.setAttribute("role", "img");
        plot.ctx.canvas.setAttribute("aria-label", named(panel));
        this.plots.push(plot);
        this.touchable(plot);
      });
      if (this.plots.length) this.tell();
    }

    // put new numbers into the same panels; the interval that is shown stays
    update(panels, ends = null) {
      const form = (some) => JSON.stringify(some.map((panel) => [titled(panel), panel.series.map(({ label, role }) => [label, role])]));
      const interval = this.interval();
      if (form(panels) !== form(this.panels)) {
        this.show(panels, ends);
      } else {
        Object.assign(this, { panels, ends });
        this.following = true;
        this.plots.forEach((plot, index) => {
          plot.setData(data(panels[index]), false);
          plot.ctx.canvas.setAttribute("aria-label", named(panels[index]));
        });
        this.following = false;
      }
      if (interval) this.set(interval);
    }

    // the interval that is shown, where it is not everything
    interval() {
      if (!this.plots.length) return null;
      const { ends, now } = this.stretch();
      return now[0] <= ends[0] && now[1] >= ends[1] ? null : now;
    }

    set([min, max]) {
      this.following = true;
      this.plots.forEach((plot) => plot.setScale("x", { min, max }));
      this.following = false;
      this.tell();
    }

    // a zoom by drag reaches the others through the shared cursor; one by any other way through here
    zoomed(source) {
      if (this.following || this.plots.length < this.panels.length) return;
      const { min, max } = source.scales.x;
      if (min == null || max == null) return;
      this.set([min, max]);
      this.moved(this.interval());
    }

    stretch() {
      const whole = this.plots.map((plot) => [plot.data[0][0], plot.data[0][plot.data[0].length - 1]]);
      const ends = this.ends || [Math.min(...whole.map(([a]) => a)), Math.max(...whole.map(([, b]) => b))];
      const { min, max } = this.plots[0].scales.x;
      return { ends, now: [min ?? ends[0], max ?? ends[1]] };
    }

    move(how) {
      if (!this.plots.length) return;
      const { ends: [first, last], now: [min, max] } = this.stretch();
      const width = max - min;
      const [centre, half] = { in: [0.5, 0.25], out: [0.5, 1], earlier: [0, 0.5], later: [1, 0.5], all: [0.5, Infinity] }[how];
      const wanted = Math.min(2 * half * width, last - first);
      const begin = Math.min(Math.max(min + centre * width - wanted / 2, first), last - wanted);
      this.set([begin, begin + wanted]);
      this.moved(this.interval());
    }

    tell() {
      const { ends, now } = this.stretch();
      const whole = now[0] <= ends[0] && now[1] >= ends[1];
      this.box.querySelector("[data-do=all]").disabled = whole;
      this.box.querySelector(".stretch").textContent = whole ? "" : `${shown(now[0])} to ${shown(now[1])} s of ${shown(ends[1])} s`;
    }

    // one finger drags over a stretch, two pinch; up and down scroll the page
    touchable(plot) {
      const held = new Map();
      let from = null;
      const place = (event) => event.clientX - plot.over.getBoundingClientRect().left;
      const chosen = (interval) => {
        this.set(interval);
        this.moved(this.interval());
      };
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
          chosen([centre - width / 2, centre + width / 2]);
        }
      });
      const end = (event) => {
        if (!held.delete(event.pointerId)) return;
        const { left, width } = plot.select;
        if (event.type === "pointerup" && from?.at !== undefined && width > 8) {
          chosen([left, left + width].map((x) => plot.posToVal(x, "x")));
        }
        plot.setSelect({ left: 0, width: 0, top: 0, height: 0 }, false);
        if (!held.size) from = null;
      };
      for (const name of ["pointerup", "pointercancel"]) plot.over.addEventListener(name, end);
    }
  }

  return Object.assign(TimePlots, { series, data, titled, shown, colour });
})();
