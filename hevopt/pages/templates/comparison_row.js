"use strict";
// The figures of the row shown in detail: traces, operating points, spells of the engine; another laid under it.

// onZoom: what to do when the traces were zoomed, by the library's event
const OneRow = (onZoom) => {
  const { plain, axis, layout } = Page;
  const { narrow, fixed, nameOf } = Look;
  const RPM = 30 / Math.PI;
  // Modes of operation as an axis has room for them; the names in full are in the data.
  const SHORT = ["stop, off", "stop, on", "recover", "brake", "electric", "engine", "assist", "charge"];
  const CELL_RPM = 50, CELL_NM = 5;
  const car = () => Shown.results.cars[Shown.results.rows[Shown.chosen].figures.architecture];

  // Traces --------------------------------------------------------------------------------------------------------

  function panels(look, n) {
    const c = Over.carOf(n), t = Shown.results.rows[n].detail.trace, colour = look.colours;
    const end = c.time_s[c.time_s.length - 1] + c.step_s[c.step_s.length - 1];
    const edges = [...c.time_s, end];
    const held = (values) => [...values, values[values.length - 1]];
    const product = (torque, speed) => torque.map((nm, k) => nm * speed[k] / 1e3);
    const step = (name, values, more = {}) => ({ name, x: edges, y: held(values), line: { shape: "hv", width: 1.3, color: look.ink, ...more.line }, unit: more.unit ?? "", digits: more.digits ?? 1, ...more.trace });
    const kw = (name, values, n, dash, width = 1.3) => step(name, values, { unit: " kW", line: { color: n < 0 ? look.muted : colour[n], dash, width } });
    const gears = [step("engine gear", t.engine_gear, { digits: 0, line: { color: colour[5] } })];
    if (t.machine_gear.some((gear) => gear > 0)) gears.push(step("machine gear", t.machine_gear, { digits: 0, line: { color: colour[1], dash: "dot", width: 1.8 } }));
    const level = (name, value) => ({ name, x: [edges[0], end], y: [100 * value, 100 * value], line: { width: 1, dash: "dot", color: look.muted }, silent: true });
    return [
      { share: 1.1, title: "speed<br>(km/h)", lines: [step("speed", c.speed_mps.map((v) => v * 3.6), { unit: " km/h", trace: { ofCycle: true } })] },
      { share: 0.8, title: "gear<br>(–)", lines: gears, axis: { rangemode: "tozero", dtick: 2 } },
      { share: 1.35, title: "mode", lines: [step("mode", t.operation, { line: { color: look.ink, width: 1.1 }, trace: { text: held(t.operation).map((n) => plain(Shown.results.operations[n])), words: true } })],
        axis: { tickvals: SHORT.map((_, n) => n), ticktext: SHORT, range: [-0.6, SHORT.length - 0.4], tickfont: { size: 10 } } },
      { share: 1.1, title: "SOC<br>(%)", lines: [{ name: "SOC", x: edges, y: t.soc.map((s) => 100 * s), line: { width: 1.5, color: colour[3] }, unit: " %", digits: 3 }, level("least", c.soc_min), level("most", c.soc_max)] },
      { share: 1.9, title: "power<br>(kW)", legend: true, lines: [
        kw("wheels", c.wheel_power_w.map((w) => w / 1e3), -1, "solid", 1.6), kw("engine shaft", product(t.engine_torque_nm, t.engine_speed_radps), 1, "solid"),
        kw("machine shaft", product(t.machine_torque_nm, t.machine_speed_radps), 5, "dash"), kw("battery", t.battery_power_w.map((w) => w / 1e3), 3, "dot", 1.7)] },
      { share: 1.2, title: "engine<br>torque (Nm)", lines: [step("engine torque", t.engine_torque_nm, { unit: " Nm", line: { color: colour[1] } })] },
      { share: 1.2, title: "machine<br>torque (Nm)", lines: [step("machine torque", t.machine_torque_nm, { unit: " Nm", line: { color: colour[5] } })] },
    ];
  }

  // The lines of the other row: pale where lines have colours of their own, else in one colour, thin.
  function under(look, parts) {
    const other = plain(nameOf(Shown.results.rows[Shown.over]));
    panels(look, Shown.over).forEach((part, n) => {
      const own = part.lines.filter((line) => !line.silent && !line.ofCycle);
      parts[n].lines.unshift(...own.map((line) => ({ ...line, name: `${line.name}, ${other}`, pale: part.legend,
        line: part.legend ? { ...line.line, width: 1 } : { ...line.line, color: look.colours[6], width: 1, dash: "solid" } })));
    });
    const excess = Over.excessG();
    if (excess) parts.push({ share: 1.5, title: "excess<br>cost (g)", marked: Over.worst(excess), lines: [{ name: "excess cost", x: parts[0].lines[0].x, y: excess, line: { width: 1.6, color: look.colours[1] }, unit: " g", digits: 2 }] });
    return parts;
  }

  function traces(look, width) {
    const parts = Shown.over < 0 ? panels(look, Shown.chosen) : under(look, panels(look, Shown.chosen)), gap = 0.022, forLegend = narrow(width) ? 0.036 : 0.014;
    const whole = parts.reduce((sum, part) => sum + part.share, 0), room = 1 - gap * (parts.length - 1) - forLegend;
    const data = [], axes = {};
    let top = 1;
    parts.forEach((part, n) => {
      if (part.legend) top -= forLegend;
      const height = room * part.share / whole, key = n === 0 ? "" : String(n + 1);
      const domain = [Math.max(0, top - height), top];
      axes[`yaxis${key}`] = axis(look, part.title, { domain, fixedrange: true, automargin: false, zeroline: true, nticks: 6, ...part.axis, title: { text: part.title, font: { size: 11 }, standoff: 4 } });
      if (part.legend) axes.legend = { orientation: "h", x: 0, xanchor: "left", y: domain[1], yanchor: "bottom", font: { size: 11 }, bgcolor: "rgba(0,0,0,0)" };
      if (part.marked) axes.marked = { from: part.marked.from, to: part.marked.to, domain };
      for (const line of part.lines) {
        data.push({ type: "scatter", mode: "lines", name: line.name, x: line.x, y: line.y, line: line.line, xaxis: "x", yaxis: `y${key}`, showlegend: Boolean(part.legend) && !line.pale, opacity: line.pale ? 0.45 : 1,
          ...(line.silent ? { hoverinfo: "skip" } : line.words ? { text: line.text, hovertemplate: "%{text}" } : { hovertemplate: `%{y:.${line.digits}f}${line.unit}` }) });
      }
      top -= height + gap;
    });
    const last = `y${parts.length}`, x = data[0].x, { marked, ...drawn } = axes;
    return { data, height: Shown.over < 0 ? undefined : 1340, on: { plotly_relayout: onZoom }, layout: layout(look, width, {
      ...drawn, hovermode: narrow(width) ? "closest" : "x unified", hoversubplots: "axis", dragmode: "zoom",
      xaxis: axis(look, "time (s)", { anchor: last, range: Shown.view ?? [x[0], x[x.length - 1]], zeroline: false, unifiedhovertitle: { text: "%{x:.1f} s" } }),
      margin: { l: narrow(width) ? 72 : 84, r: 12, t: 8, b: 44 },
      shapes: [...(marked ? [worstShape(look, marked)] : []), ...parts.slice(1).map((part, n) => {
        const y = axes[`yaxis${n === 0 ? "" : n + 1}`].domain[0] - gap / 2;
        return { type: "line", xref: "paper", yref: "paper", x0: 0, x1: 1, y0: y, y1: y, line: { color: look.rule, width: 1 } };
      })],
    }) };
  }

  const worstShape = (look, { from, to, domain }) => ({ type: "rect", xref: "x", yref: "paper", x0: from, x1: to, y0: domain[0], y1: domain[1], layer: "below", line: { width: 0 }, fillcolor: look.colours[1], opacity: 0.22 });

  // Operating points ------------------------------------------------------------------------------------------------

  // Steps of the window shown, joined in cells of speed and torque, at their weighted mean.
  function cells(speed, torque, weights, wide, high) {
    const c = car(), found = new Map();
    for (let k = 0; k < speed.length; k++) {
      if (Shown.view && (c.time_s[k] + c.step_s[k] <= Shown.view[0] || c.time_s[k] >= Shown.view[1])) continue;
      const weight = weights[k];
      if (!(weight > 0)) continue;
      const x = speed[k] * RPM, y = torque[k], key = `${Math.round(x / wide)}|${Math.round(y / high)}`;
      const cell = found.get(key) ?? { x: 0, y: 0, weight: 0, time: 0 };
      cell.x += weight * x; cell.y += weight * y; cell.weight += weight; cell.time += c.step_s[k];
      found.set(key, cell);
    }
    return [...found.values()].map((cell) => ({ ...cell, x: cell.x / cell.weight, y: cell.y / cell.weight })).sort((a, b) => b.weight - a.weight);
  }

  // most: the largest weight of all rows drawn, so that areas compare; hollow: of the row that lies under
  function pointTrace(look, found, most, unit, scale, colour, width, hollow) {
    const all = found.reduce((sum, cell) => sum + cell.weight, 0);
    const largest = narrow(width) ? 22 : 26;
    return { type: "scatter", mode: "markers", name: hollow ? "operating points of the other row" : "operating points", x: found.map((c) => c.x), y: found.map((c) => c.y),
      marker: { symbol: hollow ? "circle-open" : "circle", size: found.map((c) => c.weight), sizemode: "area", sizeref: 2 * most / largest ** 2, sizemin: 1.6, color: colour, opacity: hollow ? 0.9 : 0.62, line: hollow ? { width: 1.3 } : { color: look.paper, width: 0.7 } },
      customdata: found.map((c) => [c.weight * scale, 100 * c.weight / all, c.time]),
      hovertemplate: `%{x:.0f} rpm, %{y:.1f} Nm<br>%{customdata[0]:.3g} ${unit} (%{customdata[1]:.1f} %)<br>%{customdata[2]:.0f} s<extra></extra>`, showlegend: false };
  }

  // The points of the row shown, before them those of the row under it. of: index of a row -> its cells
  function pointTraces(look, of, unit, scale, colour, width) {
    const rows = Shown.over < 0 ? [Shown.chosen] : [Shown.over, Shown.chosen], found = rows.map(of);
    const most = Math.max(...found.flat().map((cell) => cell.weight), 1e-12);
    return rows.map((n, at) => pointTrace(look, found[at], most, unit, scale, n === Shown.chosen ? colour : look.colours[6], width, n !== Shown.chosen));
  }

  function contours(look, map, values, factor, levels, dash) {
    return { type: "contour", x: map.speed_radps.map((w) => w * RPM), y: map.torque_nm, z: map.torque_nm.map((_, j) => values.map((line) => (line[j] === null ? null : line[j] * factor))),
      autocontour: false, contours: { ...levels, coloring: "lines", showlabels: true, labelfont: { size: 10, color: look.muted } }, colorscale: [[0, look.muted], [1, look.muted]],
      line: { width: 1, dash, smoothing: 0.6 }, showscale: false, hoverinfo: "skip", connectgaps: false };
  }

  // The sheet laid over what lies beyond a limit, so that contours end at the limit and not at the grid.
  const beyond = (look, xs, ys, edge) => ({ type: "scatter", mode: "lines", x: [...xs, xs[xs.length - 1], xs[0]], y: [...ys, edge, edge], fill: "toself", fillcolor: look.paper, line: { width: 0 }, hoverinfo: "skip", showlegend: false });
  const curve = (look, xs, ys, dash, width = 2) => ({ type: "scatter", mode: "lines", x: xs, y: ys, line: { color: look.ink, width, dash }, hoverinfo: "skip", showlegend: false });

  function levelsOf(values, factor, count) {
    const flat = values.flat().filter((v) => v !== null).map((v) => v * factor).sort((a, b) => a - b);
    if (flat.length === 0) return null;
    const low = flat[Math.floor(0.04 * flat.length)], high = flat[flat.length - 1];
    const raw = (Math.min(high, flat[Math.floor(0.985 * flat.length)]) - low) / count;
    if (!(raw > 1e-9 * Math.abs(high))) return null;
    const power = 10 ** Math.floor(Math.log10(raw)), size = [1, 2, 5, 10].map((m) => m * power).find((s) => s >= raw);
    return { start: Math.ceil(low / size) * size, end: Math.floor(high / size) * size, size };
  }

  const weightChosen = () => document.querySelector("input[name=weight]:checked")?.value ?? "fuel";

  function weightsOf(kind, n, torque, speed) {
    const c = Over.carOf(n), t = Shown.results.rows[n].detail.trace;
    if (kind === "fuel") return { weights: t.fuel_kg, unit: "g", scale: 1e3 };
    if (kind === "time") return { weights: c.step_s, unit: "s", scale: 1 };
    return { weights: torque.map((nm, k) => Math.abs(nm * speed[k]) * c.step_s[k]), unit: "kJ", scale: 1e-3 };
  }

  function engineMap(values, factor, levels, colour) {
    return (look, width) => {
      const map = car().engine;
      // At rest the engine is no point of its map.
      const of = (n) => {
        const t = Shown.results.rows[n].detail.trace, { weights } = weightsOf(weightChosen(), n, t.engine_torque_nm, t.engine_speed_radps);
        return cells(t.engine_speed_radps, t.engine_torque_nm, weights.map((w, k) => (t.engine_speed_radps[k] > 0 ? w : 0)), CELL_RPM, CELL_NM);
      };
      const xs = map.speed_radps.map((w) => w * RPM), top = 1.08 * Math.max(...map.limit_nm), bottom = 1.25 * Math.min(...map.least_nm, -5);
      const shown = values(map), data = [];
      const steps = shown && levels(shown, factor);
      if (steps) data.push(contours(look, map, shown, factor, steps, "solid"));
      data.push(beyond(look, xs, map.limit_nm, top * 1.02), curve(look, xs, map.limit_nm, "solid"), curve(look, xs, map.least_nm, "dash", 1.2));
      const { unit, scale } = weightsOf(weightChosen(), Shown.chosen, [], []);
      data.push(...pointTraces(look, of, unit, scale, look.colours[colour], width));
      return { data, layout: layout(look, width, {
        xaxis: axis(look, "engine speed (rpm)", { range: [0.92 * xs[0], 1.01 * xs[xs.length - 1]], zeroline: false, nticks: 7 }),
        yaxis: axis(look, "engine torque (Nm)", { range: [bottom, top], zeroline: true }), margin: { l: 56, r: 12, t: 8, b: 44 }, hovermode: "closest",
      }) };
    };
  }

  function machineMap(look, width) {
    const map = car().machine, kind = weightChosen() === "time" ? "time" : "energy";
    const xs = map.speed_radps.map((w) => w * RPM), edge = 1.1 * Math.max(...map.torque_nm);
    const data = [], levels = levelsOf(map.efficiency, 100, 9);
    if (levels) data.push(contours(look, map, map.efficiency, 100, { ...levels, start: Math.max(levels.start, 50) }, "solid"));
    data.push(beyond(look, xs, map.limit_nm, 3 * edge), beyond(look, xs, map.least_nm, -3 * edge), curve(look, xs, map.limit_nm, "solid"), curve(look, xs, map.least_nm, "solid"));
    const wide = Math.max(CELL_RPM, xs[xs.length - 1] / 100), high = Math.max(0.05, edge / 50);
    const { unit, scale } = weightsOf(kind, Shown.chosen, [], []);
    const of = (n) => {
      const t = Shown.results.rows[n].detail.trace;
      return cells(t.machine_speed_radps, t.machine_torque_nm, weightsOf(kind, n, t.machine_torque_nm, t.machine_speed_radps).weights, wide, high);
    };
    data.push(...pointTraces(look, of, unit, scale, look.colours[5], width));
    const flat = levels ? [] : [{ xref: "paper", yref: "paper", x: 0.5, y: 0.98, showarrow: false, text: flatText(map), font: { size: 11, color: look.muted } }];
    return { data, layout: layout(look, width, {
      xaxis: axis(look, "machine speed (rpm)", { range: [0, 1.01 * xs[xs.length - 1]], zeroline: false, nticks: 7 }),
      yaxis: axis(look, "machine torque (Nm)", { range: [-edge, edge], zeroline: true }), margin: { l: 56, r: 12, t: 8, b: 44 }, hovermode: "closest", annotations: flat,
    }) };
  }

  function flatText(map) {
    const value = map.efficiency.flat().find((v) => v !== null);
    return value === undefined ? "no map" : `one efficiency: ${fixed(100 * value, 1)} %`;
  }

  // Spells ----------------------------------------------------------------------------------------------------------

  function spells(look, width) {
    const detail = Shown.results.rows[Shown.chosen].detail, ends = [2, 5, 10, 20, 50, 100, 200, Infinity];
    const labels = ends.map((end) => (end === Infinity ? "> 200" : String(end)));
    const count = (lengths) => ends.map((end, n) => lengths.filter((s) => s <= end && s > (n === 0 ? 0 : ends[n - 1])).length);
    const bar = (name, lengths, n, shape) => ({ type: "bar", name, x: labels, y: count(lengths), hovertemplate: `${name}, %{x} s: %{y}<extra></extra>`,
      marker: { color: look.colours[n], line: { color: look.ink, width: 0.6 }, pattern: { shape, fillmode: "overlay", fgcolor: look.hatch, size: 6, solidity: 0.35 } } });
    return { data: [bar("engine on", detail.engine_on_s, 1, ""), bar("engine off", detail.engine_off_s, 5, "/")], layout: layout(look, width, { bargap: 0.3,
      xaxis: axis(look, "length of the spell, up to (s)", { type: "category", fixedrange: true }), yaxis: axis(look, "spells (–)", { rangemode: "tozero", fixedrange: true, tickformat: "d", nticks: 6 }) }) };
  }

  // Finer lines near the top, where they matter.
  function efficiencyLevels(values, factor) {
    const best = factor * Math.max(...values.flat().filter((v) => v !== null));
    return { start: best - 20 > 10 ? 2 * Math.round((best - 16) / 2) : 10, end: Math.floor(best), size: best > 30 ? 2 : 1 };
  }

  return {
    traces, machineMap, spells, car,
    engineEfficiency: engineMap((map) => map.efficiency, 100, efficiencyLevels, 1),
    engineNox: engineMap((map) => map.nox_kgpj, 3.6e9, (values, factor) => levelsOf(values, factor, 8), 1),
  };
};
