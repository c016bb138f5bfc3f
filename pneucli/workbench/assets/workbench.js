// The workbench's page: it shows what the server says, asks for curves as the hand moves, and runs the commands.
(() => {
  "use strict";
  const $ = (id) => document.getElementById(id);
  const token = document.querySelector("meta[name=pneucli-token]").content;
  const HEADERS = { "X-Pneucli-Token": token };
  const STEPS = 1000; // of a slider
  const RETRY = 3000; // ms, until the page asks again for a workbench that does not answer
  const KEPT = 1000; // times of drawing
  const WORST = 4; // recordings whose error is told where more are shown
  const SETTLED = 250; // ms of rest, after which the error over all recordings is asked for
  let state = null;
  let begun = false; // whether the first curves have been asked for
  let earlier = null; // number of the model of the ladder that is shown as well
  let values = {}; // by hand, by name
  let trial = null; // effects of the model that is shown at once, until its fit has ended
  let stepped = null; // its error after one step, over all recordings
  let byName = new Map();
  const latencies = []; // ms from a move of a slider to the curves on the screen
  let drawn = 0; // how often curves came onto the screen
  let since = null; // when the hand moved what is not drawn yet
  let moving = null; // the parameter whose slider the hand moves
  let predicted = false; // whether the curves are predicted, for a simulation takes longer than the hand waits
  const plots = new TimePlots($("curves"), "workbench", { moved: () => { showVisible(); draw(); } });
  window.pneucliWorkbench = { plots, latencies, drawn: () => drawn, predicted: () => predicted, state: () => state };

  function element(name, attributes = {}, ...children) {
    const made = document.createElement(name);
    for (const [key, value] of Object.entries(attributes)) {
      if (key.startsWith("on")) made.addEventListener(key.slice(2), value);
      else if (value === true) made.setAttribute(key, "");
      else if (value !== false && value != null) made.setAttribute(key, value);
    }
    made.append(...children.filter((one) => one != null && one !== ""));
    return made;
  }

  // questions

  async function ask(path, body) {
    const sent = body === undefined ? {} : { method: "POST", body: body instanceof Blob ? body : JSON.stringify(body) };
    const response = await fetch(path, { headers: HEADERS, ...sent });
    if (!response.ok) {
      const { error } = await response.json().catch(() => ({ error: `the workbench answers ${response.status}` }));
      throw Object.assign(new Error(error), { status: response.status });
    }
    return response.headers.get("Content-Type").startsWith("application/json") ? response.json() : response.arrayBuffer();
  }

  function banner(text) {
    $("banner").textContent = text;
    $("banner").hidden = !text;
  }

  // an error of what the user asked for; one of the connection is shown by the news
  function complain(error) {
    if (error.status) banner(error.message);
  }

  const attempt = (work) => work().catch(complain);

  // curves: one question at a time, the latest wins

  let asking = false;
  let again = false;

  function unpack(buffer) {
    const length = new DataView(buffer).getUint32(0, true);
    const head = JSON.parse(new TextDecoder().decode(new Uint8Array(buffer, 4, length)));
    let at = 4 + length;
    const array = (count) => {
      const found = new Float32Array(buffer, at, count);
      at += 4 * count;
      return found;
    };
    for (const panel of head.panels) {
      panel.time = array(panel.samples);
      panel.series.forEach((one) => (one.values = array(panel.samples)));
      panel.spans = head.spans[panel.title];
    }
    return head;
  }

  async function draw() {
    if (!state?.live) return;
    since ??= performance.now();
    if (asking) {
      again = true;
      return;
    }
    asking = true;
    try {
      do {
        again = false;
        const [begin, byHand] = [since ?? performance.now(), moving !== null];
        since = null;
        const wanted = {
          focus: focus(), values, moving, earlier, interval: plots.interval(), free_run: $("free-run").checked,
          effects: trial, step: trial !== null, samples: Math.round(2 * Math.max($("curves").clientWidth, 200)),
        };
        const head = unpack(await ask("curves", wanted));
        const all = places();
        plots.update(head.panels, [all[0].begin, all.at(-1).end], all);
        predicted = head.predicted;
        tellErrors(head.errors);
        requestAnimationFrame(() => setTimeout(() => {
          if (byHand) latencies.push(performance.now() - begin);
          if (latencies.length > KEPT) latencies.shift();
          drawn += 1;
        }));
      } while (again);
    } catch (error) {
      complain(error);
    } finally {
      asking = false;
      if (settles) settle();
    }
  }

  // the error of each channel of the recording that is shown; of several, that of the worst channel of the worst ones
  function tellErrors(errors) {
    const names = [...new Set(errors.map((one) => one.recording))];
    const worst = (name) => errors.filter((one) => one.recording === name).reduce((a, b) => (b.ratio > a.ratio ? b : a));
    const some = names.length > 1 ? names.map(worst).sort((a, b) => b.ratio - a.ratio).slice(0, WORST) : errors;
    $("errors").replaceChildren(
      predicted ? element("span", { class: "mark" }, "predicted while the slider moves") : "",
      predicted ? " " : "",
      ...some.flatMap((one, i) => [
        i ? " · " : "",
        element("span", { class: "number" }, names.length > 1 ? `${one.recording}: ` : "", `${one.channel} `, element("b", { class: one.ratio > 2 ? "bad-text" : "good-text" }, one.text), ` (${one.size})`),
      ]),
      names.length > WORST ? ` · the other ${names.length - WORST}: less` : "",
    );
  }

  let settling = 0;
  let settles = false; // whether values were moved since the last rest
  function settle() {
    clearTimeout(settling);
    settling = setTimeout(() => attempt(async () => {
      if (asking) return; // the rest begins when the curves of the last move are there
      settles = false;
      moving = null;
      if (predicted) draw(); // simulated, now that the hand rests
      if (!Object.keys(values).length) return void ($("by-hand").textContent = "");
      const { train, test } = await ask("error", { focus: focus(), values, effects: trial });
      const parts = [["held out", test], ["fitted", train]].filter(([, v]) => v != null);
      $("by-hand").textContent = `By hand, all recordings: ${parts.map(([name, v]) => `${v.toPrecision(3)} × noise ${name}`).join(", ")}`;
    }), SETTLED);
  }

  // the page

  function show() {
    $("name").textContent = `${state.name ?? "workbench"}`;
    document.title = `${state.name ?? "workbench"} – pneucli workbench`;
    showCommand();
    if (state.broken) {
      banner(state.broken);
      return;
    }
    byName = new Map(state.parameters.map((one) => [one.name, one]));
    showTiles();
    showRecordings();
    showLadder();
    showEffects();
    showParameters();
    showChapters();
    $("obstacle").textContent = state.problem;
    $("obstacle").hidden = state.live || !state.problem;
  }

  const ratio = (value) => (value == null ? "–" : value >= 100 ? value.toFixed(0) : value.toPrecision(3));

  function showTiles() {
    const { train, test } = state.error;
    $("error").textContent = test === undefined ? "–" : ratio(test ?? train);
    $("error-text").textContent = test === undefined ? "not compared yet" : `${test == null ? "" : "held-out recordings; "}${ratio(train)} on those fitted; 1 is the noise floor`;
    $("error-tile").className = `tile ${test === undefined ? "" : state.lacks ? "bad" : "good"}`;
    const { sentence, missing, next } = state.diagnosis;
    const old = state.stale.diagnose && sentence ? " (of an earlier model)" : "";
    $("verdict").textContent = sentence ? `${sentence}${old}${next ? ` Next: ${next}` : ""}` : "none yet: press Diagnose";
    $("verdict-tile").className = `tile ${sentence && !old ? (missing.length ? "bad" : "good") : ""}`;
  }

  function showCommand() {
    const { command, lines } = state;
    const running = Boolean(command?.running);
    const named = (state.diagnosis?.missing ?? []).filter((name) => state.effects?.some((one) => one.name === name && !one.in_model));
    for (const button of $("buttons").querySelectorAll("[data-action]")) {
      const action = button.dataset.action;
      button.disabled = running || Boolean(state.broken) || (action === "add-named" && !named.length);
      button.title = lines?.[action] ?? "";
    }
    const next = named.length ? "add-named" : state.stale?.compare ? "fit" : state.stale?.diagnose ? "diagnose" : state.lacks ? "plan" : "report";
    $("buttons").querySelectorAll("button").forEach((one) => one.classList.toggle("primary", one.dataset.action === next && !one.disabled));
    $("undo").disabled = running || !state.undo;
    $("undo").title = state.undo ? `take back: ${state.undo.title}${state.undo.line ? ` (${state.undo.line})` : ""}` : "";
    $("cancel").hidden = $("bar").hidden = !running;
    $("report").hidden = !state.report;
    $("report").href = `report?token=${token}`;
    if (command) $("line").textContent = command.line;
    $("command-line").hidden = !command;
    $("progress").textContent = !command ? "" : running ? command.progress || "starting" : command.cancelled ? command.text : command.failed ? "It failed:" : `${command.name}: done`;
    $("result").hidden = running || !command?.text || command.cancelled;
    if (command?.failed) $("result").open = true;
    $("text").textContent = command?.text ?? "";
  }

  // where the recordings are on the axis, and which of them are shown
  const places = () => state.recordings.filter((one) => one.place).map((one) => ({ ...one.place, held: one.use === "test" }));
  function shown() {
    const [from, to] = plots.interval() ?? [-Infinity, Infinity];
    return places().filter(({ begin, end }) => Math.min(end, to) - Math.max(begin, from) > 0.01 * Math.min(end - begin, to - from));
  }
  const focus = () => (shown()[0] ?? places()[0])?.name ?? "";

  function showRecordings() {
    keepFocus($("recordings"), state.recordings.map((one) =>
      element("li", {}, element("button", { type: "button", "data-key": one.name, disabled: !one.place, onclick: () => choose(one) },
        element("span", { class: "grow" }, one.name),
        one.use === "test" ? element("span", { class: "mark" }, "held out") : "",
        element("span", { class: `number ${one.error > 2 ? "bad-text" : "good-text"}`, title: "largest error of a channel, × noise" }, one.text)))));
    if (state.live && !begun) {
      begun = true;
      plots.set(span(worst()));
    }
    showVisible();
  }

  function showVisible() {
    const names = new Set(shown().map(({ name }) => name));
    for (const button of $("recordings").querySelectorAll("button")) button.setAttribute("aria-current", String(names.has(button.dataset.key)));
    const [one] = state.recordings.filter(({ name }) => names.has(name));
    $("recording").textContent = names.size > 1 ? `${names.size} recordings, one after the other` : one ? `${one.name}${one.use === "test" ? " (held out: never fitted to)" : ""}` : "Curves";
  }

  // the recording that is shown first: the worst of those that were held out
  function worst() {
    const some = state.recordings.filter((one) => one.place);
    const held = some.filter((one) => one.use === some[0]?.use);
    return held.reduce((most, one) => (one.error > most.error ? one : most), held[0]);
  }

  const span = (one) => (one?.place ? [one.place.begin, one.place.end] : null);

  function choose(one) {
    plots.set(span(one));
    showVisible();
    draw();
  }

  const modelName = (effects) => (effects.length ? `base + ${effects.join(" + ")}` : "base model");

  function showLadder() {
    if (!state.ladder.some((one) => one.number === earlier && !one.current)) earlier = null;
    keepFocus($("ladder"), state.ladder.map((one) =>
      element("li", { class: one.current ? "now" : "" }, element("button", { type: "button", "data-key": one.number, "aria-pressed": String(one.number === earlier), disabled: one.current && "disabled",
        onclick: () => { earlier = earlier === one.number ? null : one.number; showLadder(); draw(); } },
        element("span", { class: "grow" }, modelName(one.effects), one.current ? " (now)" : ""),
        element("span", { class: "number" }, `${one.text} × noise`),
        bar(one.bar)))));
    if (trial === null || stepped === null) return;
    const most = Math.max(stepped, ...state.ladder.map(({ error }) => error.test ?? error.train));
    $("ladder").append(element("li", { class: "now" }, element("button", { type: "button", disabled: true },
      element("span", { class: "grow" }, `${modelName(trial)} (one step; the fit runs)`),
      element("span", { class: "number" }, `${ratio(stepped)} × noise`),
      bar(stepped > 1 ? Math.log(stepped) / Math.log(most) : 0))));
  }

  function bar(share) {
    const made = element("span", { class: "step", "aria-hidden": "true" });
    made.style.backgroundSize = `max(2px, ${Math.round(100 * share)}%) 100%`;
    return made;
  }

  // replace the content of a list; what had the focus has it again
  function keepFocus(target, content) {
    const focused = target.contains(document.activeElement) ? document.activeElement.dataset.key : undefined;
    const open = new Set([...target.querySelectorAll("details[open]")].map((one) => one.dataset.key));
    target.replaceChildren(...content);
    target.querySelectorAll("details").forEach((one) => (one.open ||= open.has(one.dataset.key)));
    if (focused !== undefined) [...target.querySelectorAll("[data-key]")].find((one) => one.dataset.key === focused)?.focus();
  }

  function showEffects() {
    const groups = [
      ["In the model, on the base model of gas, valve and friction", (one) => one.in_model, false],
      ["Named by the diagnosis", (one) => !one.in_model && one.verdict === "named", false],
      ["Tested and not needed", (one) => !one.in_model && one.verdict === "rejected", true],
      ["The rest of the catalogue", (one) => !one.in_model && !one.verdict, true],
    ];
    const content = [];
    for (const [title, belongs, folded] of groups) {
      const rows = state.effects.filter(belongs).map(effect);
      if (!rows.length && folded) continue;
      const none = title.startsWith("In") ? "no effect yet" : state.diagnosis.sentence ? "none" : "press Diagnose";
      content.push(folded
        ? element("details", { "data-key": title }, element("summary", {}, `${title} (${rows.length})`), ...rows)
        : element("div", {}, element("h3", {}, title), ...(rows.length ? rows : [element("p", { class: "small" }, none)])));
    }
    keepFocus($("effects"), content);
  }

  function effect(one) {
    const said = [one.probability, one.share, one.size].filter(Boolean).join("; ");
    const more = element("details", { "data-key": `why ${one.name}`, ontoggle: (event) => event.target.open && describe(one.name, event.target) },
      element("summary", {}, "what it is", one.why ? ", and why" : ""), one.why ? element("p", {}, one.why) : "");
    return element("div", { class: `effect ${one.verdict}` },
      element("button", { type: "button", "data-key": one.name, "aria-pressed": String(one.in_model), disabled: state.command?.running && "disabled",
        "aria-label": `${one.in_model ? "remove" : "add"} ${one.name}: ${one.title}`, onclick: () => change(one) },
        element("span", { class: "grow" }, element("span", { class: "name" }, one.name), ` ${one.title}`)),
      said ? element("p", {}, said) : "", more);
  }

  function svgOf(text) {
    const found = new DOMParser().parseFromString(text, "image/svg+xml").documentElement;
    found.querySelectorAll("script").forEach((one) => one.remove());
    return document.importNode(found, true);
  }

  const describe = (name, target) => attempt(async () => {
    if (target.dataset.pictured !== undefined) return;
    target.dataset.pictured = "";
    const { title, looks_like: looks, separate, svg } = await ask(`effect/${encodeURIComponent(name)}`);
    target.append(element("p", {}, looks), element("p", {}, separate ? `To separate it: ${separate}` : ""));
    if (svg) {
      const picture = svgOf(svg);
      picture.setAttribute("role", "img");
      picture.setAttribute("aria-label", `a standard experiment with and without ${title}`);
      target.append(element("figure", {}, picture));
    }
  });

  function showChapters() {
    const titles = { where: "Where the model fails, over its states", valve: "Valve map, with the data", friction: "Friction, with the data" };
    if ($("chapters").childElementCount && $("chapters").dataset.version === String(state.ladder.find((one) => one.current)?.when)) return;
    $("chapters").dataset.version = String(state.ladder.find((one) => one.current)?.when);
    keepFocus($("chapters"), state.chapters.map((name) =>
      element("details", { "data-key": name, ontoggle: (event) => event.target.open && attempt(() => chapter(name, event.target)) }, element("summary", {}, titles[name] ?? name))));
  }

  async function chapter(name, target) {
    if (target.dataset.filled !== undefined) return;
    target.dataset.filled = "";
    const wait = element("p", { class: "small", role: "status" }, "drawing …");
    target.append(wait);
    const figures = await ask(`chapter/${name}`).finally(() => wait.remove());
    if (!figures.length) target.append(element("p", { class: "small" }, "these recordings have none"));
    target.append(element("div", { class: "figures" }, ...figures.map(({ caption, svg }) => {
      const picture = svgOf(svg);
      picture.setAttribute("aria-label", caption);
      return element("figure", {}, picture, element("figcaption", {}, caption));
    })));
  }

  // parameters

  const toStep = ({ range: [low, high], logarithmic }, value) =>
    STEPS * (logarithmic ? Math.log(value / low) / Math.log(high / low) : (value - low) / (high - low));
  const fromStep = ({ range: [low, high], logarithmic }, step) =>
    logarithmic ? low * (high / low) ** (step / STEPS) : low + ((high - low) * step) / STEPS;
  const display = (one, value) => `${TimePlots.shown(value * one.factor)}${one.unit ? ` ${one.unit}` : ""}`;
  const group = (name) => (name.startsWith("valve") ? "valve" : name.split(".")[0]);

  function showParameters() {
    for (const name of Object.keys(values)) if (!byName.get(name)?.range) delete values[name];
    const groups = new Map();
    for (const one of state.parameters) groups.set(group(one.name), [...(groups.get(group(one.name)) ?? []), one]);
    keepFocus($("parameters"), [...groups].map(([name, some]) =>
      some.length > 6
        ? element("details", { "data-key": name }, element("summary", {}, `${name} (${some.length})`), ...some.map(parameter))
        : element("div", {}, element("h3", {}, name), ...some.map(parameter))));
    $("reset-all").disabled = !Object.keys(values).length;
  }

  function parameter(one) {
    const running = state.command?.running && "disabled";
    const value = values[one.name] ?? one.value;
    const typed = element("input", { type: "text", id: `typed ${one.name}`, "data-key": `typed ${one.name}`, "aria-label": `${one.name}, with its unit`, value: display(one, value), disabled: !one.range && "disabled", autocomplete: "off", spellcheck: "false" });
    const row = element("div", { class: "row" }, element("label", { for: `slide ${one.name}` }, one.name.replace(/^[^.]*\./, "")), typed);
    const box = element("div", { class: `parameter${one.name in values ? " moved" : ""}` }, row);
    if (!one.range) {
      box.append(element("div", { class: "small" }, one.text));
      return box;
    }
    const slider = element("input", { type: "range", id: `slide ${one.name}`, "data-key": `slide ${one.name}`, min: 0, max: STEPS, step: 1, "aria-valuetext": display(one, value) });
    slider.value = toStep(one, value);
    const ends = one.ci95.map((end, i) => Math.min(Math.max(end == null ? (i ? STEPS : 0) : toStep(one, Math.max(end, one.logarithmic ? 1e-300 : -Infinity)), 0), STEPS));
    const slide = element("div", { class: "slide" }, slider);
    ends.forEach((end, i) => slide.style.setProperty(["--from", "--to"][i], end / STEPS));
    const reset = element("button", { type: "button", "data-key": `reset ${one.name}`, "aria-label": `reset ${one.name}`, disabled: !(one.name in values) && "disabled" }, "reset");
    const lock = element("button", { type: "button", "data-key": `lock ${one.name}`, "aria-pressed": String(one.fixed), "aria-label": `${one.fixed ? "free" : "fix"} ${one.name} in the pipeline file`, disabled: running }, one.fixed ? "fixed" : "fix");
    const set = (now) => {
      if (now === undefined) delete values[one.name];
      else values[one.name] = now;
      const shown = now ?? one.value;
      typed.value = display(one, shown);
      slider.setAttribute("aria-valuetext", display(one, shown));
      reset.disabled = now === undefined;
      box.classList.toggle("moved", now !== undefined);
      $("reset-all").disabled = !Object.keys(values).length;
      settles = true;
      clearTimeout(settling);
      draw();
    };
    slider.addEventListener("input", () => {
      moving = one.name;
      set(fromStep(one, Number(slider.value)));
    });
    reset.addEventListener("click", () => {
      slider.value = toStep(one, one.value);
      set(undefined);
    });
    lock.addEventListener("click", () => attempt(async () => {
      await ask("fix", { name: one.name, version: state.version, unit: one.si, value: one.fixed ? null : values[one.name] ?? one.value });
      delete values[one.name];
    }));
    typed.addEventListener("change", () => attempt(async () => {
      const text = typed.value.trim().replace("−", "-");
      const bare = /^[-+\d.eE]+$/.test(text);
      try {
        const { value: found } = bare ? { value: Number(text) / one.factor } : await ask("quantity", { text, unit: one.si });
        typed.setAttribute("aria-invalid", String(!Number.isFinite(found)));
        if (!Number.isFinite(found)) return;
        slider.value = toStep(one, found);
        set(found);
        banner("");
      } catch (error) {
        typed.setAttribute("aria-invalid", "true");
        throw error;
      }
    }));
    box.append(slide, element("div", { class: "row" }, element("span", { class: "small grow" }, one.text), lock, reset));
    return box;
  }

  $("reset-all").addEventListener("click", () => {
    values = {};
    showParameters();
    $("by-hand").textContent = "";
    draw();
  });

  // what changes the file

  async function command(action, names = []) {
    banner("");
    await ask("command", { action, names, version: state.version });
    state.command = { ...state.command, name: action, line: state.lines[action] ?? `pneucli ${[action, state.file, ...names].join(" ")}`, running: true, progress: "starting", text: "" };
    showCommand();
  }

  // show a model at once, before its fit has ended
  async function tryOut(effects) {
    values = {};
    trial = effects;
    stepped = null;
    if (!state.live) return;
    draw();
    const { train, test } = await ask("error", { focus: focus(), values, effects, step: true });
    if (trial !== effects) return; // the fit has ended
    stepped = test ?? train;
    showLadder();
  }

  const change = (one) => attempt(async () => {
    if (state.command?.running) return;
    const present = state.effects.filter((other) => other.in_model).map((other) => other.name);
    await command(one.in_model ? "remove" : "add", [one.name]);
    await tryOut(one.in_model ? present.filter((name) => name !== one.name) : [...present, one.name]);
  });

  for (const button of document.querySelectorAll("[data-action]")) {
    const action = button.dataset.action;
    button.addEventListener("click", () => attempt(async () => {
      await command(action);
      if (action === "add-named") await tryOut([...state.effects.filter((one) => one.in_model).map((one) => one.name), ...state.diagnosis.missing]);
    }));
  }
  $("undo").addEventListener("click", () => attempt(() => ask("undo", { version: state.version })));
  $("cancel").addEventListener("click", () => attempt(() => ask("cancel", {})));
  $("free-run").addEventListener("change", draw);

  // a new recording

  let dropped = "";
  const take = (file) => attempt(async () => {
    if (!file) return;
    banner("");
    ({ file: dropped } = await ask(`drop?name=${encodeURIComponent(file.name)}`, file));
    $("result").open = true;
    $("init").textContent = `Make a pipeline of ${dropped}`;
    $("init").hidden = false;
  });
  $("file").addEventListener("change", () => take($("file").files[0]));
  $("init").addEventListener("click", () => attempt(() => command("init", [dropped])));
  addEventListener("dragover", (event) => {
    event.preventDefault();
    document.body.classList.add("dropping");
  });
  addEventListener("dragleave", () => document.body.classList.remove("dropping"));
  addEventListener("drop", (event) => {
    event.preventDefault();
    document.body.classList.remove("dropping");
    take(event.dataTransfer.files[0]);
  });

  // news

  let fetching = false;
  let stale = false;
  async function refresh() {
    if (fetching) return void (stale = true);
    fetching = true;
    try {
      do {
        stale = false;
        const before = state;
        state = await ask("state");
        const running = Boolean(state.command?.running);
        const model = (some) => some?.ladder?.find((one) => one.current)?.number;
        if (model(before) !== model(state)) {
          values = {};
          earlier = null;
          $("by-hand").textContent = "";
        }
        if (!running) trial = null;
        if (before && JSON.stringify({ ...before, command: null }) === JSON.stringify({ ...state, command: null }) && Boolean(before.command?.running) === running) {
          showCommand();
        } else {
          const moved = before?.version && before.version !== state.version && !before.command?.running && !running;
          if (moved) banner("Another program changed the pipeline file; the page shows it as it is now.");
          show();
          if (!running || !before?.live) draw();
        }
      } while (stale);
    } catch (error) {
      complain(error);
    } finally {
      fetching = false;
    }
  }

  function listen() {
    const news = new WebSocket(`ws://${location.host}/events?token=${token}`);
    let opened = false;
    news.addEventListener("open", () => {
      opened = true;
      banner("");
    });
    news.addEventListener("message", refresh);
    news.addEventListener("close", async () => {
      const refused = await fetch("state", { headers: HEADERS }).then((response) => response.status === 403, () => false);
      if (refused) return banner("This page belongs to an earlier workbench. Take the address that the terminal shows now.");
      banner(`The workbench ${opened ? "has ended or does not answer" : "does not answer"}. To start it again: pneucli workbench ${state?.file ?? "PIPELINE"}`);
      setTimeout(listen, RETRY);
    });
  }
  listen();
})();
