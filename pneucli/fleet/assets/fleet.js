"use strict";
(() => {
  const data = JSON.parse(document.getElementById("data").textContent);
  const word = (i) => data.words[i];
  const [RIG, DATE, DATES, VERDICT, MISSING, CHANGES, EVIDENCE, ERROR, FAILURE, LINK, BREAKS] = Array(11).keys();
  const PAGE = 100;
  const PANELS = 48;
  const get = (id) => document.getElementById(id);
  const made = (tag, text, kind) => {
    const one = document.createElement(tag);
    if (text !== undefined) one.textContent = text;
    if (kind) one.className = kind;
    return one;
  };
  const number = (v) => (v === null ? "–" : String(v).replace("-", "−"));
  const change = (c) => `${word(c[0])}: ${number(c[1])} → ${number(c[2])}${word(c[3]) === "1" ? "" : " " + word(c[3])}`;
  const shown = {
    [DATE]: (r) => word(r[DATE]),
    [VERDICT]: (r) => word(r[VERDICT]),
    [MISSING]: (r) => r[MISSING].map(word).join(", "),
    [CHANGES]: (r) => r[CHANGES].map(change).join("; "),
    [ERROR]: (r) => number(r[ERROR]),
    [FAILURE]: (r) => (r[FAILURE] ? r[FAILURE][1] : ""),
  };
  const text = (r, by) => (shown[by] ? shown[by](r) : String(r[by]));
  const places = data.rigs.map((rig, place) => ({ rig, place }));
  const searched = data.rigs.map((r) =>
    [r[RIG], text(r, MISSING), text(r, CHANGES), text(r, FAILURE), r[FAILURE] ? word(r[FAILURE][0]) : ""].join(" ").toLowerCase(),
  );
  const state = {
    changed: (r) => r[CHANGES].length > 0,
    failed: (r) => r[FAILURE] !== null,
    break: (r) => r[BREAKS].length > 0,
    "": () => true,
  };
  let order = { by: null, down: false };
  let start = 0;
  let chosen = [];

  function choose() {
    const words = get("text").value.toLowerCase().split(/\s+/).filter(Boolean);
    const verdict = get("verdict").value;
    const holds = state[get("state").value];
    chosen = places.filter(
      ({ rig, place }) =>
        holds(rig) && (!verdict || word(rig[VERDICT]) === verdict) && words.every((w) => searched[place].includes(w)),
    );
    if (order.by !== null) {
      const numeric = [DATES, EVIDENCE, ERROR].includes(order.by);
      const key = ({ rig }) => (numeric ? (rig[order.by] ?? -1) : text(rig, order.by));
      const compare = (a, b) => (numeric ? a - b : a.localeCompare(b, "en", { numeric: true }));
      chosen.sort((a, b) => (order.down ? -1 : 1) * compare(key(a), key(b)) || a.place - b.place);
    }
    start = 0;
    show();
  }

  function show() {
    const body = document.querySelector("#rigs tbody");
    body.replaceChildren(...chosen.slice(start, start + PAGE).map(({ rig }) => line(rig)));
    const last = Math.min(start + PAGE, chosen.length);
    get("count").textContent = `${chosen.length ? start + 1 : 0} to ${last} of ${chosen.length}`;
    get("less").disabled = start === 0;
    get("more").disabled = last === chosen.length;
    trends();
  }

  function line(rig) {
    const row = made("tr");
    const name = made("td");
    if (rig[LINK]) {
      const link = made("a", rig[RIG]);
      link.href = rig[LINK];
      name.append(link);
    } else name.textContent = rig[RIG];
    row.append(name);
    for (let by = DATE; by <= FAILURE; by++) {
      const kind = [DATES, EVIDENCE, ERROR].includes(by) ? "number" : by === FAILURE ? "bad" : "";
      row.append(made("td", by === EVIDENCE && !rig[EVIDENCE] ? "" : text(rig, by), kind));
    }
    return row;
  }

  function trends() {
    const places = new Map(chosen.slice(start, start + PAGE).map(({ place }, i) => [place, i]));
    const mine = data.trends.filter((t) => places.has(t[0]));
    mine.sort((a, b) => places.get(a[0]) - places.get(b[0]));
    get("trends").replaceChildren(...mine.slice(0, PANELS).map(panel));
  }

  function panel([place, name, unit, from, to, values, errors, breaks]) {
    const figure = made("figure");
    const low = Math.min(...values.map((v, i) => v - errors[i]));
    const high = Math.max(...values.map((v, i) => v + errors[i]));
    const x = (i) => 4 + (192 * i) / Math.max(values.length - 1, 1);
    const y = (v) => 56 - (52 * (v - low)) / (high - low || 1);
    const svg = document.createElementNS("http://www.w3.org/2000/svg", "svg");
    svg.setAttribute("viewBox", "0 0 200 60");
    svg.setAttribute("preserveAspectRatio", "none");
    const draw = (tag, kind, attributes) => {
      const one = document.createElementNS("http://www.w3.org/2000/svg", tag);
      one.setAttribute("class", kind);
      for (const [key, value] of Object.entries(attributes)) one.setAttribute(key, value);
      svg.append(one);
    };
    breaks.forEach((b) => draw("line", "level", { x1: x(b - 0.5), x2: x(b - 0.5), y1: 0, y2: 60 }));
    values.forEach((v, i) => {
      draw("line", "error", { x1: x(i), x2: x(i), y1: y(v - errors[i]), y2: y(v + errors[i]) });
      draw("circle", "dot", { cx: x(i), cy: y(v), r: 2 });
    });
    const range = `${Math.min(...values)} to ${Math.max(...values)} ${word(unit) === "1" ? "" : word(unit)}`;
    figure.append(svg, made("figcaption", `${data.rigs[place][RIG]}, ${word(name)}: ${range}, ${word(from)} to ${word(to)}`));
    return figure;
  }

  function bars(id, title, counts) {
    const most = Math.max(1, ...Object.values(counts));
    const rows = Object.entries(counts).map(([name, n]) => {
      const row = made("button", undefined, "row");
      const bar = made("span");
      bar.style.width = `${(100 * n) / most}%`;
      row.append(made("span", name), bar, made("span", n));
      row.addEventListener("click", () => find(name));
      return row;
    });
    get(id).replaceChildren(...(title ? [made("h3", title)] : []), ...(rows.length ? rows : [made("p", "none")]));
  }

  function find(words) {
    get("text").value = words;
    get("state").value = "";
    choose();
    document.querySelector("main").scrollIntoView();
  }

  const verdicts = [...new Set(data.rigs.map((r) => word(r[VERDICT])))].sort();
  get("verdict").append(...verdicts.map((v) => Object.assign(made("option", v), { value: v })));
  bars("changes", "changed, in rigs", data.changes);
  bars("missing", "missing from the model, in rows", data.missing);
  bars("failures", "", Object.fromEntries(data.failures.map((f) => [f.cause, f.rows])));
  for (const id of ["text", "verdict", "state"]) get(id).addEventListener("input", choose);
  for (const tile of document.querySelectorAll(".tile"))
    tile.addEventListener("click", () => {
      get("state").value = tile.dataset.state;
      choose();
    });
  for (const head of document.querySelectorAll("#rigs th"))
    head.addEventListener("click", () => {
      const by = Number(head.dataset.by);
      order = { by, down: order.by === by ? !order.down : [DATES, EVIDENCE, ERROR].includes(by) };
      document.querySelectorAll("#rigs th").forEach((h) => (h.className = h === head ? (order.down ? "down" : "up") : ""));
      choose();
    });
  get("less").addEventListener("click", () => { start = Math.max(0, start - PAGE); show(); });
  get("more").addEventListener("click", () => { start += PAGE; show(); });
  choose();
})();
