// The report's page: its zoomable plots, what is printed in their place, and links into folded chapters.
(() => {
  "use strict";
  const SHORT = 27; // rows
  const floats = (text) => new Float32Array(Uint8Array.from(atob(text), (c) => c.charCodeAt(0)).buffer);
  const unpacked = (panel) => ({
    ...panel,
    time: floats(panel.time),
    series: panel.series.map((one) => ({ ...one, values: floats(one.values) })),
  });
  const content = JSON.parse(document.getElementById("plots").textContent);
  const drawn = (window.pneucliPlots = {});
  const printed = [];

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
      for (const panel of run.panels.map(unpacked)) {
        if (panel.series.every(({ role }) => role === "input")) continue;
        const caption = document.createElement("p");
        caption.textContent = TimePlots.titled(panel);
        const small = { show: true, size: 14, stroke: TimePlots.colour("faint"), font: "8px sans-serif", grid: { show: false }, ticks: { size: 2 }, gap: 1 };
        const made = new uPlot(
          {
            width: 240, height: 62, pxAlign: 0, legend: { show: false }, cursor: { show: false }, padding: [2, 2, 0, 0],
            scales: { x: { time: false } },
            series: [{}, ...TimePlots.series(panel).map((s) => ({ ...s, width: s.width / 2, points: { show: false } }))],
            axes: [{ ...small, space: 60 }, { ...small, size: 30, space: 22, values: (plot, ticks) => ticks.map(TimePlots.shown) }],
          },
          TimePlots.data(panel),
        );
        printed.push(made);
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

  let opened = [];
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
    printed.splice(0).forEach((plot) => plot.destroy());
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
    const plots = new TimePlots(box, name);
    drawn[name] = plots.plots;
    const again = () => plots.show(runs[choice.value].panels.map(unpacked));
    choice.addEventListener("change", again);
    again();
  }
})();
