// Time plots, for the report and the workbench: one uPlot a panel, all over the same interval of time, with one cursor.
// A panel is { title, unit, start, restarts, spans, time, series: [{ label, role, values }] }, its arrays Float32Array.
// Where recordings follow one another on the axis, each has a place { name, begin, end, first, held }: it goes from begin
// to end of the axis, and its own first time is first.
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
    for (const time of times || []) {
      const x = Math.round(plot.valToPos(time, "x", true));
      if (x < bbox.left || x > bbox.left + bbox.width) continue;
      ctx.beginPath();
      ctx.moveTo(x, bbox.top);
      ctx.lineTo(x, bbox.top + 7 * devicePixelRatio);
      ctx.stroke();
    }
    ctx.restore();
  }

  // call `paint` for each recording on the axis, within its part of the plot
  function recordings(plot, places, paint) {
    const { ctx, bbox } = plot;
    for (const place of places) {
      const [left, right] = [place.begin, place.end].map((t) => Math.min(Math.max(plot.valToPos(t, "x", true), bbox.left), bbox.left + bbox.width));
      if (right <= left) continue;
      ctx.save();
      ctx.beginPath();
      ctx.rect(left, bbox.top, right - left, bbox.height);
      ctx.clip();
      paint(ctx, bbox, left, right, place);
      ctx.restore();
    }
  }

  // those held out are tinted, each begins with a line
  function ground(ctx, { top, height }, left, right, { held }) {
    ctx.fillStyle = colour(held ? "raised" : "ground");
    ctx.fillRect(left, top, right - left, height);
    ctx.fillStyle = colour("faint");
    ctx.fillRect(left, top, devicePixelRatio, height);
  }

  function label(ctx, { top }, left, right, { name, held }) {
    if (right - left <= 40 * devicePixelRatio) return;
    ctx.font = `${11 * devicePixelRatio}px system-ui, "DejaVu Sans", sans-serif`;
    ctx.textBaseline = "top";
    ctx.textAlign = "left";
    ctx.fillStyle = colour("faint");
    ctx.fillText(held ? `${name} · held out` : name, left + 5 * devicePixelRatio, top + 9 * devicePixelRatio);
  }

  // nothing is drawn between two recordings: a clipped line would leave a pixel of its way from one to the other
  function between(plot, places) {
    const { ctx, bbox } = plot;
    ctx.fillStyle = colour("ground");
    places.slice(1).forEach(({ begin }, i) => {
      const [left, right] = [places[i].end, begin].map((t) => Math.min(Math.max(plot.valToPos(t, "x", true), bbox.left), bbox.left + bbox.width));
      ctx.fillRect(left + devicePixelRatio, bbox.top, Math.max(right - left - devicePixelRatio, 0), bbox.height);
    });
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
      Object.assign(this, { box, group, height, moved, plots: [], panels: [], ends: null, places: [], chosen: null });
      Object.assign(this, { following: false, width: 0, telling: 0 });
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
      matchMedia("(prefers-color-scheme: dark)").addEventListener("change", () => this.draw());
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
        padding: [null, 12, null, null], // the same of each plot: their axes stand below one another
        legend: { live: true },
        cursor: { y: false, sync: { key: this.group }, drag: { x: true, y: false }, points: { size: 6 }, bind: { dblclick: () => () => this.move("all") } },
        scales: { x: { time: false } },
        series: [{ label: "t in s", value: (plot, v) => this.own(v) }, ...series(panel)],
        axes: [
          { ...axis, size: 34, ...(this.places.length ? { splits: this.ticks.bind(this), values: (plot, ticks) => ticks.map((t) => this.own(t, false)) } : {}) },
          { ...axis, size: 62, space: 24, values: (plot, ticks) => ticks.map(shown) },
        ],
        hooks: {
          setScale: [(plot, scale) => scale === "x" && this.zoomed(plot)],
          drawClear: [
            (plot) => recordings(plot, this.places, ground),
            (plot) => shade(plot, now().spans),
            (plot) => index === 0 && recordings(plot, this.places, label), // on the shading
          ],
          draw: [
            (plot) => between(plot, this.places),
            (plot) => restarts(plot, now().restarts),
          ],
        },
      };
    }

    // the recording at a time of the axis
    place(time) {
      return this.places.find(({ begin, end }) => time >= begin && time <= end);
    }

    // a time of the axis as the recording has it
    own(time, named = true) {
      const at = time == null ? undefined : this.place(time);
      if (!at) return this.places.length ? "–" : shown(time);
      const text = Number((time - at.begin + at.first).toPrecision(4)).toString();
      return named && this.places.length > 1 ? `${text} (${at.name})` : text;
    }

    // ticks at round times of each recording
    ticks(plot, axis, min, max, step) {
      const found = [];
      for (const { begin, end, first } of this.places) {
        const shift = begin - first;
        for (let k = Math.ceil((Math.max(begin, min) - shift) / step - 1e-6); k * step + shift <= Math.min(end, max); k += 1) {
          const time = Math.max(k * step + shift, begin);
          if (!found.length || time - found.at(-1) > 0.6 * step) found.push(time);
        }
      }
      return found;
    }

    // draw panels anew, everything of them; see `update`
    show(panels, ends = null, places = []) {
      Object.assign(this, { panels, ends, places, chosen: null });
      this.draw();
    }

    draw() {
      this.plots.splice(0).forEach((plot) => plot.destroy());
      this.target.replaceChildren();
      this.panels.forEach((panel, index) => {
        const title = document.createElement("h3");
        title.textContent = titled(panel);
        this.target.append(title);
        const plot = new uPlot(this.options(index, panel), undefined, this.target);
        plot.ctx.canvas.setAttribute("role", "img");
        plot.ctx.canvas.setAttribute("aria-label", named(panel));
        this.plots.push(plot);
        this.touchable(plot);
      });
      this.fill();
    }

    // put new numbers into the same panels, and keep the interval that is shown; `ends` are those of everything where
    // the panels hold a part of it only
    update(panels, ends = null, places = []) {
      const form = (some) => JSON.stringify(some.map((panel) => [titled(panel), panel.series.map(({ label, role }) => [label, role])]));
      const same = form(panels) === form(this.panels) && Boolean(places.length) === Boolean(this.places.length);
      Object.assign(this, { panels, ends, places });
      if (same) this.fill();
      else this.draw();
    }

    fill() {
      if (!this.plots.length) return;
      const numbers = this.panels.map(data);
      const { now: [min, max] } = this.stretch();
      this.following = true;
      this.plots.forEach((plot, index) => plot.batch(() => {
        plot.setData(numbers[index], false);
        plot.setScale("x", { min, max });
      }));
      this.following = false;
      this.tell();
      clearTimeout(this.telling);
      this.telling = setTimeout(() => this.plots.forEach((plot, i) => plot.ctx.canvas.setAttribute("aria-label", named(this.panels[i]))), 200);
    }

    // the interval that is shown, where it is not everything
    interval() {
      return this.chosen;
    }

    // show an interval; null: everything
    set(interval) {
      const { ends } = this.stretch();
      if (interval && this.panels.length && interval[0] <= ends[0] && interval[1] >= ends[1]) interval = null;
      this.chosen = interval;
      if (!this.plots.length) return;
      const { now: [min, max] } = this.stretch();
      this.following = true;
      this.plots.forEach((plot) => plot.batch(() => plot.setScale("x", { min, max })));
      this.following = false;
      this.tell();
    }

    // a zoom by drag reaches the others through the shared cursor; one by any other way through here
    zoomed(source) {
      if (this.following) return;
      const { min, max } = source.scales.x;
      const { now } = this.stretch();
      if (min == null || max == null || (min === now[0] && max === now[1])) return;
      this.set([min, max]);
      this.moved(this.interval());
    }

    stretch() {
      const whole = this.panels.map(({ start, time }) => [start + (time[0] ?? 0), start + (time.at(-1) ?? 0)]);
      const ends = this.ends || [Math.min(...whole.map(([a]) => a)), Math.max(...whole.map(([, b]) => b))];
      return { ends, now: this.chosen ?? ends };
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
      this.box.querySelector("[data-do=all]").disabled = !this.chosen;
      const [from, to] = now.map((time) => this.places.find(({ end }) => time <= end) ?? this.places.at(-1));
      const said = (time, at) => (at ? `${this.own(Math.min(Math.max(time, at.begin), at.end), false)} s${from === to ? "" : ` of ${at.name}`}` : shown(time));
      const of = from ? "" : ` s of ${shown(ends[1])} s`;
      this.box.querySelector(".stretch").textContent = this.chosen ? `${said(now[0], from)} to ${said(now[1], to)}${of}` : "";
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
