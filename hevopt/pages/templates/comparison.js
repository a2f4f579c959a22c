"use strict";
// A comparison: which row and which time window are shown, and what the controls do.

(() => {
  const { byId, figure, draw } = Page;
  const { styleOf, nameOf, fixed } = Look;
  const own = OneRow(follow);

  // Choosing a row and a window ---------------------------------------------------------------------------------------

  const DETAIL = ["traces", "engine-efficiency", "engine-nox", "machine-map", "sankey", "flow-apart", "spells"];
  const MAPS = ["engine-efficiency", "engine-nox", "machine-map"];

  function choose(index) {
    Shown.chosen = index;
    const row = Shown.results.rows[index], f = row.figures;
    byId("row").value = String(index);
    for (const place of document.querySelectorAll(".chosen-name")) place.textContent = nameOf(row);
    for (const block of document.querySelectorAll("[data-row]")) block.hidden = block.dataset.row !== `${f.architecture}|${f.strategy}`;
    for (const line of byId("comparison").tBodies[0].rows) line.classList.toggle("chosen", line.dataset.index === String(index));
    byId("row-facts").textContent = `${fixed(f.fuel_l_per_100km, 3)} l/100 km · NOx ${f.nox_mg_per_km === null ? "unknown" : `${fixed(f.nox_mg_per_km, 0)} mg/km`} · ${f.gap_percent === null ? "no bound" : `${fixed(f.gap_percent, 3)} % above the bound`} · ${f.status}`;
    if (Shown.over === index) Shown.over = -1;
    showWindow();
    showOther();
    DETAIL.forEach(draw);
    Page.say(`showing ${nameOf(row)}`);
  }

  function lay(index) {
    Shown.over = index === Shown.chosen ? -1 : index;
    showOther();
    DETAIL.forEach(draw);
    Over.write();
    Page.say(Shown.over < 0 ? "one row alone" : `${nameOf(Shown.results.rows[Shown.over])} laid under it`);
  }

  function showOther() {
    const excess = Over.excessG();
    byId("over").value = String(Shown.over);
    byId("over-facts").textContent = Over.facts(excess);
    byId("worst").hidden = !excess;
    byId("figure-flow-apart").hidden = Shown.over < 0;
    byId("optimum").hidden = Over.optimum() === Shown.chosen;
  }

  function limits() {
    const c = own.car(), n = c.time_s.length - 1;
    return [c.time_s[0], c.time_s[n] + c.step_s[n]];
  }

  function showWindow() {
    const [from, to] = Shown.view ?? limits();
    byId("from").value = String(Number(from.toFixed(1)));
    byId("to").value = String(Number(to.toFixed(1)));
  }

  function setView(range, redraw) {
    const [low, high] = limits();
    const clipped = range && [Math.max(low, Math.min(...range)), Math.min(high, Math.max(...range))];
    Shown.view = clipped && clipped[1] > clipped[0] && (clipped[0] > low || clipped[1] < high) ? clipped : null;
    showWindow();
    if (redraw) draw("traces");
    MAPS.forEach(draw);
    Over.write();
  }

  function pick(index) {
    choose(index);
    Over.write();
  }

  // Show what the address asks for; whether it asks for anything.
  function follows() {
    const asked = Over.read();
    if (!asked) return false;
    Shown.over = asked.over === asked.row ? -1 : asked.over;
    Shown.view = asked.view;
    choose(asked.row);
    byId("row-section").scrollIntoView();
    return true;
  }

  function controls() {
    byId("row").addEventListener("change", (event) => pick(Number(event.target.value)));
    byId("over").addEventListener("change", (event) => lay(Number(event.target.value)));
    byId("optimum").addEventListener("click", () => lay(Over.optimum()));
    byId("worst").addEventListener("click", () => {
      const { from, to } = Over.worst(Over.excessG());
      setView([from, to], true);
    });
    addEventListener("hashchange", follows);
    for (const button of document.querySelectorAll("button.choose")) {
      button.addEventListener("click", () => {
        pick(Number(button.dataset.index));
        byId("row-section").scrollIntoView();
        byId("row").focus({ preventScroll: true });
      });
    }
    byId("window").addEventListener("submit", (event) => {
      event.preventDefault();
      const range = [Number(byId("from").value), Number(byId("to").value)];
      setView(range.every(Number.isFinite) ? range : null, true);
    });
    byId("whole").addEventListener("click", () => setView(null, true));
    for (const input of document.querySelectorAll("input[name=weight]")) input.addEventListener("change", () => MAPS.forEach(draw));
  }

  function follow(change) {
    if (change["xaxis.range[0]"] !== undefined) setView([change["xaxis.range[0]"], change["xaxis.range[1]"]], false);
    else if (change["xaxis.autorange"]) setView(null, true);
  }

  function showEffects() {
    for (const block of document.querySelectorAll("[data-effects]")) block.hidden = block.dataset.effects !== byId("effects-of").value;
    draw("sensitivity");
  }

  // As `writing.csv_cells`: an apostrophe before a sign at which a spreadsheet would begin a formula.
  const FORMULA = /^(?=[\s\0\ufeff']*[=+\-@\uff1d\uff0b\uff0d\uff20][^]|'*[\t\r\n])|(?<=[;|\t\r\n])(?='*[=+\-@\uff1d\uff0b\uff0d\uff20][^])/g;
  const inert = (text) => text.replace(FORMULA, "'");

  function csv() {
    const keys = Object.keys(Shown.results.rows[0].figures);
    const cell = (value) => (value === null ? "" : typeof value === "number" ? String(value) : `"${inert(String(value)).replace(/"/g, '""')}"`);
    return [keys.join(","), ...Shown.results.rows.map((row) => keys.map((key) => cell(row.figures[key])).join(","))].join("\n") + "\n";
  }

  function register() {
    AllRows.change();
    if (byId("row")) {
      figure("traces", own.traces);
      figure("engine-efficiency", own.engineEfficiency);
      figure("engine-nox", own.engineNox);
      figure("machine-map", own.machineMap);
      figure("sankey", Flow.sankey);
      figure("flow-apart", Flow.differences);
      figure("shares", AllRows.shares);
      figure("spells", own.spells);
    }
    const family = (id, capped, build) => (AllRows.calibrated(capped).length ? figure(id, build) : byId(`figure-${id}`)?.remove());
    for (const key of ["threshold_w", "threshold_mps", "threshold_soc"]) {
      const id = `calibration-${key}`;
      if (AllRows.hasLine(key)) figure(id, (look, width) => AllRows.thresholds(look, width, key));
      else byId(`figure-${id}`)?.remove();
    }
    family("calibration-plane", true, AllRows.plane);
    if (Shown.results.pareto) figure("pareto-front", AllRows.pareto);
    if (byId("effects-of")) {
      figure("sensitivity", AllRows.sensitivity);
      byId("effects-of").addEventListener("change", showEffects);
      showEffects();
    }
  }

  Page.start((data) => {
    Shown.results = data;
    Shown.names = [...new Set(data.rows.map((row) => row.figures.strategy))].sort((a, b) => styleOf(a) - styleOf(b));
    byId("download").addEventListener("click", () => Page.save(Page.bytes("packed-data"), "application/gzip", "results.json.gz"));
    byId("download-table").addEventListener("click", () => Page.save(csv(), "text/csv", "comparison.csv"));
    register();
    if (byId("row")) {
      controls();
      if (!follows()) choose(Number(byId("row").value));
    }
  });
})();
