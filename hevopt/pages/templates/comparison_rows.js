"use strict";
// What a comparison shows, and its figures over all rows. Data are in SI; units change here, where they are drawn.

// The data; names of strategies in the order of legends; index of the row shown in detail, and of the one laid under
// it or -1; their time window, or null.
const Shown = { results: null, names: [], chosen: -1, over: -1, view: null };

const Look = (() => {
  const short = (name) => (name.length > 14 ? `${name.slice(0, 13)}…` : name);
  const FAMILIES = ["baseline", "start_stop", "conventional", "nox_cut", "ecms", "dp", "convex", "mpc", "a_ecms", "sdp"];
  return {
    HATCHES: ["", "/", "\\", "x", ".", "-", "|", "+", "", "/"],
    DASHES: ["solid", "dash", "dot", "dashdot", "longdash", "longdashdot"],
    SYMBOLS: ["circle", "square", "diamond", "triangle-up", "triangle-down", "x", "cross", "star"],
    // A shipped strategy looks the same in every comparison; others follow in the order of their rows.
    styleOf: (strategy) => {
      if (FAMILIES.includes(strategy)) return FAMILIES.indexOf(strategy);
      const names = Shown.results.rows.map((row) => row.figures.strategy);
      return FAMILIES.length + [...new Set(names)].filter((name) => !FAMILIES.includes(name)).indexOf(strategy);
    },
    nameOf: (row) => `${row.figures.architecture} ${row.figures.strategy}`,
    // Names as an axis or a legend has room for them; in full in tables and where the mouse rests.
    short,
    shortNameOf: (row) => `${short(row.figures.architecture)} ${row.figures.strategy}`,
    narrow: (width) => width < 560,
    fixed: (value, digits) => value.toFixed(digits).replace("-", "−"),
  };
})();

const AllRows = (() => {
  const { byId, plain, axis, layout, figure } = Page;
  const { HATCHES, DASHES, SYMBOLS, styleOf, nameOf, short, shortNameOf, narrow, fixed } = Look;
  const MODE_COLOURS = [0, 9, 3, 6, 4, 2, 1, 5];

  // What a label needs of a figure's height.
  const LABEL_SHARE = 0.065;

  // Bars ----------------------------------------------------------------------------------------------------------

  function places() {
    const slots = [];
    let x = 0, last = null;
    Shown.results.rows.forEach((row) => {
      if (last !== null && row.figures.architecture !== last) x += 0.9;
      last = row.figures.architecture;
      slots.push({ row, x });
      x += 1;
    });
    return slots;
  }

  function groupTicks(slots) {
    const groups = new Map();
    for (const slot of slots) {
      const name = slot.row.figures.architecture;
      if (!groups.has(name)) groups.set(name, []);
      groups.get(name).push(slot.x);
    }
    return {
      tickvals: [...groups.values()].map((xs) => (xs[0] + xs[xs.length - 1]) / 2),
      ticktext: [...groups.keys()].map((name) => plain(short(name))),
    };
  }

  // value and bound: figures -> number, or null; told: of a value; limit: drawn across, or null
  function bars(value, bound, title, { told = signed, unit = "%", limit = null } = {}) {
    return (look, width) => {
      const slots = places(), data = [];
      for (const strategy of Shown.names) {
        const own = slots.filter((slot) => slot.row.figures.strategy === strategy && value(slot.row.figures) !== null);
        const n = styleOf(strategy);
        data.push({
          type: "bar", name: plain(strategy), x: own.map((s) => s.x), y: own.map((s) => value(s.row.figures)), width: 0.86,
          marker: { color: look.colours[n % 10], line: { color: look.ink, width: 0.6 },
            pattern: { shape: HATCHES[(n + 3 * Math.floor(n / 10)) % 10], fillmode: "overlay", fgcolor: look.hatch, size: 6, solidity: 0.35 } },
          customdata: own.map((s) => plain(nameOf(s.row))), hovertemplate: `%{customdata}: %{y:${unit === "%" ? "+.2f" : ".1f"}} ${unit}<extra></extra>`,
        });
      }
      const valued = slots.filter((slot) => value(slot.row.figures) !== null);
      if (bound) {
        const xs = [], ys = [], texts = [];
        for (const slot of valued) {
          const at = bound(slot.row.figures);
          if (at === null) continue;
          xs.push(slot.x - 0.5, slot.x + 0.5, null);
          ys.push(at, at, null);
          texts.push(plain(nameOf(slot.row)), plain(nameOf(slot.row)), "");
        }
        data.push({ type: "scatter", mode: "lines", name: "certified bound", x: xs, y: ys, text: texts, line: { color: look.ink, width: 2.5 },
          hovertemplate: "%{text}, bound: %{y:+.3f} %<extra></extra>" });
      }
      const ends = valued.flatMap((s) => [value(s.row.figures), bound?.(s.row.figures) ?? 0]);
      const span = slots[slots.length - 1].x + 2, slot = (width - 80) / span;
      const spare = LABEL_SHARE * (Math.max(0, ...ends) - Math.min(0, ...ends));
      const labels = slot <= 30 ? [] : valued.map((s) => {
        const v = value(s.row.figures), at = bound?.(s.row.figures) ?? v, up = v > 0 || (v === 0 && !bound);
        // On the bar's own side: between it and its bound where there is room, else beyond the bound.
        const end = Math.abs(at - v) > spare ? v : up ? Math.max(v, at) : Math.min(v, at);
        return { x: s.x, y: end, text: told(v), showarrow: false, yanchor: up ? "bottom" : "top", yshift: up ? 2 : -3, font: { size: 11, color: look.ink } };
      });
      const all = [...ends, limit ?? 0];
      const low = Math.min(0, ...all), high = Math.max(0, ...all), room = Math.max(0.09 * (high - low), 0.5), down = low < 0 ? room : 0;
      return { data, layout: layout(look, width, {
        xaxis: axis(look, "architecture", { ...groupTicks(slots), range: [-1, slots[slots.length - 1].x + 1], showgrid: false, zeroline: false, fixedrange: true, ticks: "" }),
        yaxis: axis(look, title, { range: [low - down, high + room], zeroline: true, zerolinewidth: 1.2, fixedrange: true }),
        margin: { l: 62, r: 10, t: 12, b: 44 }, annotations: labels,
        shapes: limit === null ? [] : [{ type: "line", xref: "paper", x0: 0, x1: 1, y0: limit, y1: limit, line: { color: look.ink, width: 1.6, dash: "dash" }, label: { text: `limit ${limit} mg/km`, textposition: "end", font: { size: 11, color: look.ink } } }],
      }) };
    };
  }

  const signed = (v) => (Math.abs(v) < 0.05 ? "+0.0" : `${v > 0 ? "+" : ""}${fixed(v, 1)}`);

  function change() {
    const reference = Shown.results.rows.find((row) => nameOf(row) === Shown.results.reference);
    if (!reference) return;
    const base = reference.figures, against = `change against ${plain(Shown.results.reference)} (%)`;
    const part = (figure, whole) => (figure === null || !whole ? null : 100 * (figure / whole - 1));
    const cost = (f) => (f.bound_l_per_100km === null || f.gap_percent === null ? null : f.bound_l_per_100km * (1 + f.gap_percent / 100));
    const weighted = Shown.results.nox_weight > 0;
    figure("fuel-bars", bars((f) => f.delta_fuel_percent, weighted ? null : (f) => part(f.bound_l_per_100km, base.fuel_l_per_100km), `fuel, ${against}`));
    figure("cost-bars", bars((f) => part(cost(f), cost(base)), (f) => part(f.bound_l_per_100km, cost(base)), `objective, ${against}`));
    figure("nox-bars", bars((f) => f.delta_nox_percent, null, `NO<sub>x</sub>, ${against}`));
    figure("nox-level-bars", bars((f) => f.nox_mg_per_km, null, "NO<sub>x</sub> (mg/km)", { told: (v) => fixed(v, 0), unit: "mg/km", limit: Shown.results.nox_limit_mg_per_km ?? null }));
  }

  // Operation -------------------------------------------------------------------------------------------------------

  function shares(look, width) {
    const solved = Shown.results.rows.filter((row) => row.detail);
    const labels = solved.map((row) => plain(nameOf(row)));
    const data = Shown.results.operations.map((operation, n) => {
      const parts = solved.map((row) => {
        const all = row.detail.shares.reduce((sum, share) => sum + share.time_s, 0);
        return 100 * (row.detail.shares.find((share) => share.operation === operation)?.time_s ?? 0) / all;
      });
      return { type: "bar", orientation: "h", name: plain(operation), y: labels, x: parts, hovertemplate: `%{y}<br>${plain(operation)}: %{x:.1f} %<extra></extra>`,
        marker: { color: look.colours[MODE_COLOURS[n]], line: { color: look.paper, width: 0.5 }, pattern: { shape: HATCHES[n], fillmode: "overlay", fgcolor: look.hatch, size: 6, solidity: 0.35 } } };
    }).filter((trace) => trace.x.some((share) => share > 0));
    const rows = narrow(width) ? 5 : 2;
    return { height: 24 * solved.length + 80 + 22 * rows, data, layout: layout(look, width, { barmode: "stack", bargap: 0.25,
      xaxis: axis(look, "share of time (%)", { range: [0, 100], fixedrange: true }), yaxis: axis(look, "", { autorange: "reversed", tickvals: labels, ticktext: solved.map((row) => plain(shortNameOf(row))), ticks: "", fixedrange: true, showgrid: false, tickfont: { size: 11 } }),
      margin: { l: 60, r: 14, t: 10, b: 44 }, legend: { orientation: "h", x: 0, y: 1, yanchor: "bottom", traceorder: "normal", font: { size: 11 } } }) };
  }

  // Calibration, Pareto front, sensitivity ----------------------------------------------------------------------------

  const carNames = () => [...new Set(Shown.results.rows.map((row) => row.figures.architecture))];
  const lineOf = (look, n, more = {}) => ({ color: look.colours[[5, 1, 3, 2, 6, 4, 0, 7, 8, 9][n % 10]], width: 1.6, dash: DASHES[n % DASHES.length], ...more });
  const ring = (look, members, x, y) => ({ type: "scatter", mode: "markers", x: members.map(x), y: members.map(y), hoverinfo: "skip", showlegend: false, marker: { symbol: "circle-open", size: 16, line: { width: 2.2 }, color: look.ink } });

  function calibrated(capped) {
    return Shown.results.rows.filter((row) => row.detail?.calibration.length && (row.detail.calibration[0].nox_cap_kgps !== null) === capped);
  }

  // The lines of a calibration through the member taken: over each threshold, the others kept.
  const LINES = {
    threshold_w: { factor: 1e-3, digits: ".2f", unit: " kW", title: "electric below (kW at the wheels)" },
    threshold_mps: { factor: 3.6, digits: ".0f", unit: " km/h", title: "electric below (km/h)" },
    threshold_soc: { factor: 1, digits: ".3f", unit: "", title: "electric above (state of charge)" },
  };
  const hasLine = (key) => calibrated(false).some((row) => row.detail.calibration[0][key] !== null);
  function lineOver(row, key) {
    const members = row.detail.calibration, taken = members.find((m) => m.chosen), others = Object.keys(LINES).filter((other) => other !== key);
    return members.filter((m) => m[key] !== null && others.every((other) => m[other] === taken[other])).sort((a, b) => a[key] - b[key]);
  }

  function thresholds(look, width, key) {
    const data = [], { factor, digits, unit, title } = LINES[key], x = (m) => m[key] * factor, y = (m) => m.corrected_l_per_100km;
    for (const row of calibrated(false)) {
      const n = carNames().indexOf(row.figures.architecture), line = lineOf(look, n), members = lineOver(row, key);
      data.push({ type: "scatter", mode: "lines+markers", name: plain(shortNameOf(row)), x: members.map(x), y: members.map(y), line,
        marker: { symbol: members.map((m) => SYMBOLS[n % SYMBOLS.length] + (m.neutral ? "" : "-open")), size: 6, color: line.color },
        customdata: members.map((m) => [m.nox_mg_per_km === null ? "unknown" : `${fixed(m.nox_mg_per_km, 0)} mg/km`, m.surplus_j / 1e3]), hovertemplate: `${plain(nameOf(row))}<br>%{x:${digits}}${unit}: %{y:.3f} l/100 km<br>NO<sub>x</sub> %{customdata[0]}, end surplus %{customdata[1]:+.1f} kJ<extra></extra>` });
      data.push(ring(look, members.filter((m) => m.chosen), x, y));
    }
    return { data, layout: layout(look, width, { xaxis: axis(look, title, key === "threshold_soc" ? {} : { rangemode: "tozero" }), yaxis: axis(look, `${Shown.results.nox_weight ? "objective" : "fuel"}, corrected (l/100 km)`) }) };
  }

  function plane(look, width) {
    const data = [], x = (m) => m.corrected_l_per_100km, y = (m) => m.nox_mg_per_km;
    for (const row of calibrated(true)) {
      const n = carNames().indexOf(row.figures.architecture), line = lineOf(look, n, { width: 1.2 }), members = row.detail.calibration;
      [...new Set(members.map((m) => m.threshold_w))].forEach((threshold) => {
        const own = members.filter((m) => m.threshold_w === threshold), taken = own.some((m) => m.chosen);
        data.push({ type: "scatter", mode: "lines+markers", name: plain(shortNameOf(row)), legendgroup: `family ${n}`, showlegend: taken, opacity: taken ? 1 : 0.4, x: own.map(x), y: own.map(y), line,
          marker: { symbol: own.map((m) => SYMBOLS[n % SYMBOLS.length] + (m.neutral ? "" : "-open")), size: 6, color: line.color },
          customdata: own.map((m) => [m.threshold_w / 1e3, m.nox_cap_kgps * 1e6]), hovertemplate: `${plain(nameOf(row))}<br>%{x:.3f} l/100 km, %{y:.0f} mg/km<br>electric below %{customdata[0]:.2f} kW, cap %{customdata[1]:.2f} mg/s<extra></extra>` });
      });
      data.push(ring(look, members.filter((m) => m.chosen), x, y));
    }
    return { data, layout: layout(look, width, { xaxis: axis(look, `${Shown.results.nox_weight ? "objective" : "fuel"}, corrected (l/100 km)`), yaxis: axis(look, "NO<sub>x</sub> (mg/km)"), hovermode: "closest" }) };
  }

  // The level edge before the first corner and the last edge beyond the points are drawn as far as the points go.
  function outerFront(front) {
    const most = Math.max(...front.points.map((p) => p.nox_mg_per_km)), corners = front.outer;
    if (corners.length === 0) return [];
    return [{ nox_mg_per_km: Math.max(most, corners[0].nox_mg_per_km), fuel_l_per_100km: corners[0].fuel_l_per_100km }, ...corners];
  }

  function pareto(look, width) {
    const data = [], bounds = [];
    Shown.results.pareto.forEach((front, n) => {
      const line = lineOf(look, n), outer = outerFront(front), name = plain(front.architecture), label = plain(short(front.architecture));
      data.push({ type: "scatter", mode: "lines+markers", name: label, legendgroup: name, x: front.points.map((p) => p.fuel_l_per_100km), y: front.points.map((p) => p.nox_mg_per_km),
        line, marker: { symbol: SYMBOLS[n % SYMBOLS.length], size: 8 }, customdata: front.points.map((p) => p.nox_weight),
        hovertemplate: `${name}, weight %{customdata:.3~r}<br>%{x:.3f} l/100 km, %{y:.1f} mg/km<extra></extra>` });
      // Where the proof is tight it lies on the points' own line, and is seen only in ink, and last.
      bounds.push({ type: "scatter", mode: "lines", name: "proven outer front", legendgroup: name, showlegend: n === 0, x: outer.map((c) => c.fuel_l_per_100km), y: outer.map((c) => c.nox_mg_per_km),
        line: { color: look.ink, width: 1, dash: "solid" }, hoverinfo: "skip" });
    });
    data.push(...bounds);
    return { data, layout: layout(look, width, { xaxis: axis(look, "fuel (l/100 km)"), yaxis: axis(look, "NO<sub>x</sub> (mg/km)"), hovermode: "closest" }) };
  }

  function sensitivity(look, width) {
    const small = narrow(width), chosenName = byId("effects-of").value;
    const lines = Shown.results.sensitivity.filter((line) => `${line.architecture} ${line.strategy}` === chosenName);
    const effect = (line) => Math.max(...line.delta_percent.map(Math.abs));
    lines.sort((a, b) => effect(b) - effect(a)).reverse();
    const span = (line) => [line.values[0], line.values[line.values.length - 1]].map((v) => String(Number(v.toPrecision(4)))).join(" to ");
    const labels = lines.map((line) => plain(small ? line.parameter : `${line.parameter}, ${span(line)} ${line.unit}`));
    const bar = (name, key, end, panel, n, shape) => ({ type: "bar", orientation: "h", name, y: labels, x: lines.map((line) => (end ? line[key][line[key].length - 1] : line[key][0])), xaxis: `x${panel}`, yaxis: `y${panel}`,
      showlegend: panel === "", customdata: lines.map((line) => plain(`${end ? line.values[line.values.length - 1] : line.values[0]} ${line.unit}`)), hovertemplate: `%{y}<br>at %{customdata}: %{x:+.2f} %<extra></extra>`,
      marker: { color: look.colours[n], line: { color: look.ink, width: 0.6 }, pattern: { shape, fillmode: "overlay", fgcolor: look.hatch, size: 6, solidity: 0.35 } } });
    const data = [["delta_percent", ""], ["delta_nox_percent", "2"]].flatMap(([key, panel]) => [bar("at the lower value", key, false, panel, 5, ""), bar("at the higher value", key, true, panel, 2, "/")]);
    const x = (title, more) => axis(look, title, { zeroline: true, zerolinewidth: 1.4, fixedrange: true, ...more });
    const y = (more) => axis(look, "", { ticks: "", fixedrange: true, showgrid: false, tickfont: { size: 11 }, ...more });
    const apart = small ? { x: [[0, 1], [0, 1]], y: [[0.57, 1], [0, 0.43]] } : { x: [[0, 0.48], [0.52, 1]], y: [[0, 1], [0, 1]] };
    return { height: (small ? 2 : 1) * (30 * lines.length + 60) + 60, data, layout: layout(look, width, {
      barmode: "group", bargap: 0.22,
      xaxis: x("fuel, change (%)", { anchor: "y", domain: apart.x[0] }), xaxis2: x("NO<sub>x</sub>, change (%)", { anchor: "y2", domain: apart.x[1] }),
      yaxis: y({ anchor: "x", domain: apart.y[0] }), yaxis2: y({ anchor: "x2", domain: apart.y[1], showticklabels: small }),
    }) };
  }

  return { change, shares, calibrated, hasLine, thresholds, plane, pareto, sensitivity };
})();
