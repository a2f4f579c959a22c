"use strict";
// The figures of tip-ins: traces over time, overlays, the compressor map, torque over speed, the filled hole.

(() => {
  const { byId, plain, axis, layout, figure, draw } = Page;
  const HUES = [5, 1, 3, 6, 2, 4, 8, 7, 0];
  const DASHES = ["solid", "dash", "dot", "dashdot", "longdash"];
  const LAST_S = 5;

  let data, chosen = 0;

  const narrow = (width) => width < 640;
  const of = (look, n) => look.colours[HUES[n % HUES.length]];
  const line = (x, y, name, colour, more = {}) => ({ type: "scatter", mode: "lines", x, y, name, hovertemplate: `${name}: %{y:.3~f}<extra></extra>`, ...more, line: { color: colour, width: 1.8, ...more.line } });
  const dashed = { line: { dash: "dash", width: 1.3 } };

  // Panels below each other with one time axis; lines: [values, name, hue, more].
  function panels(c) {
    const helped = c.assist.some((value) => value > 0);
    return [
      ["acceleration<br>(m/s²)", [[c.accel, "mean value", 5], [c.map, "steady map", 0, dashed]]],
      ["torque (Nm)", [[c.torque, "engine", 5], ...(helped ? [[c.torque.map((t, n) => t + c.assist[n]), "engine and machine", 3]] : []), [c.full, "full load", 0, dashed]]],
      ["pressure<br>(bar abs.)", [[c.boost, "boost", 5], [c.target, "target", 0, dashed], [c.exhaust, "before turbine", 1]]],
      ["turbocharger<br>(1000/min)", [[c.turbo, "turbocharger", 5]]],
      ["λ (–)", [[c.lambda, "λ", 5], [c.limit, "smoke limit", 1, dashed]], [0.8, 3]],
      ["opening (%)", [[c.vanes, "vanes", 5], [c.vanes_asked, "vanes asked", 0, dashed], [c.egr, "recirculation valve", 6]]],
      ["flow (g/s)", [[c.air, "air", 5], [c.returned, "recirculated", 6]]],
      ["T before<br>turbine (K)", [[c.kelvin, "temperature", 1]]],
    ];
  }

  function time(look, width) {
    const c = data.cases[chosen], rows = panels(c), gap = 0.018, high = (1 - gap * (rows.length - 1)) / rows.length;
    const own = {}, traces = [], notes = [];
    rows.forEach(([title, lines, range], n) => {
      const key = n === 0 ? "" : String(n + 1), top = 1 - n * (high + gap);
      own[`yaxis${key}`] = axis(look, title, { domain: [top - high, top], anchor: "x", nticks: 5, zeroline: false, title: { text: title, font: { size: 11 }, standoff: 4 }, ...(range ? { range } : {}) });
      lines.forEach(([values, name, hue, more = {}], k) => {
        traces.push(line(c.t, values, name, look.colours[hue], { yaxis: `y${key}`, showlegend: false, ...more }));
        notes.push({ xref: "paper", x: 1.008, xanchor: "left", yref: "paper", y: top - 0.004 - 0.0145 * k, yanchor: "top", showarrow: false, text: plain(name), font: { size: narrow(width) ? 10 : 11, color: look.colours[hue] } });
      });
    });
    const marks = [["torque_90", "90 % torque"], ["boost_90", "90 % boost"]].filter(([name]) => c[name] !== null && c[name] < LAST_S).sort(([a], [b]) => c[a] - c[b]);
    const shapes = marks.map(([name]) => ({ type: "line", x0: c[name], x1: c[name], yref: "paper", y0: 0, y1: 1, line: { color: look.muted, width: 1, dash: "dot" } }));
    marks.forEach(([name, text], n) => notes.push({ x: c[name], y: 1, yref: "paper", yanchor: "bottom", xanchor: n === 0 && marks.length > 1 ? "right" : "left", showarrow: false, text: `${text}: ${c[name].toFixed(2)} s`, font: { size: 11, color: look.muted } }));
    return { data: traces, fresh: true, layout: layout(look, width, { ...own, shapes, annotations: notes, hovermode: "x unified", showlegend: false, margin: { l: 74, r: narrow(width) ? 104 : 124, t: 26, b: 46 },
      xaxis: axis(look, "time after the pedal begins to move (s)", { range: [-0.05, LAST_S], anchor: `y${rows.length}`, zeroline: false }) }) };
  }

  function overlay(look, width) {
    const rows = data.groups.length, columns = narrow(width) ? 1 : 2, own = {}, traces = [], titles = [];
    data.groups.forEach((group, r) => [["accel", "acceleration (m/s²)"], ["boost", "boost (bar abs.)"]].forEach(([name, title], k) => {
      const n = 2 * r + k, key = n === 0 ? "" : String(n + 1);
      own[`xaxis${key}`] = axis(look, "time (s)", { anchor: `y${key}`, range: [0, LAST_S], zeroline: false });
      own[`yaxis${key}`] = axis(look, title, { anchor: `x${key}`, nticks: 6, zeroline: false });
      titles.push({ xref: `x${key} domain`, yref: `y${key} domain`, x: 0.985, y: 0.03, xanchor: "right", yanchor: "bottom", showarrow: false, text: group.title, font: { size: 12, color: look.muted } });
      group.cases.forEach((m, j) => {
        const c = data.cases[m];
        traces.push(line(c.t, c[name], plain(c.label), j === 0 ? look.ink : of(look, m - 1), { xaxis: `x${key}`, yaxis: `y${key}`, showlegend: k === 0 && (j > 0 || r === 0), legendgroup: c.label, line: { dash: DASHES[m % DASHES.length], width: j === 0 ? 2.2 : 1.6 } }));
      });
    }));
    const cells = rows * (columns === 1 ? 2 : 1);
    // The library gives a legend no more than half the height, and lets what is left of it cover the plots.
    const longest = Math.max(...data.cases.map((c) => c.label.length)), each = Math.max(1, Math.floor((width - 76) / (36 + 6.7 * longest)));
    const legend = 29 * Math.ceil(traces.filter((one) => one.showlegend).length / each);
    return { height: Math.max(60 + 280 * cells + legend, 40 + 2 * legend), data: traces, layout: layout(look, width, { ...own, annotations: titles, grid: { rows: cells, columns, pattern: "independent", xgap: 0.14, ygap: 0.28 }, margin: { l: 62, r: 14, t: 12, b: 48 } }) };
  }

  function compressor(look, width) {
    const { lines, islands, surge } = data.map, c = data.cases[chosen], traces = [];
    islands.forEach((island) => traces.push({ type: "scatter", mode: "lines", x: island.flow, y: island.ratio, line: { color: look.colours[3], width: 1 }, showlegend: false, hovertemplate: `efficiency ${island.level}<extra></extra>` }));
    lines.forEach((one) => traces.push({ type: "scatter", mode: "lines", x: one.flow, y: one.ratio, line: { color: look.muted, width: 1 }, showlegend: false, hovertemplate: `${one.krpm} 000/min<extra></extra>` }));
    traces.push({ type: "scatter", mode: "lines", x: surge.flow, y: surge.ratio, name: "surge line", line: { color: look.colours[1], width: 2.4 }, hoverinfo: "skip" });
    traces.push({ type: "scatter", mode: "lines", x: c.flow, y: c.ratio, name: plain(c.label), line: { color: look.colours[5], width: 2.6 }, customdata: c.t, hovertemplate: "%{customdata:.2f} s: %{x:.1f} g/s, %{y:.2f}<extra></extra>" });
    const at = data.marked.map((t) => c.t.findIndex((own) => own >= t - 1e-9)).filter((n) => n >= 0);
    traces.push({ type: "scatter", mode: "markers", x: at.map((n) => c.flow[n]), y: at.map((n) => c.ratio[n]), marker: { size: 7, color: look.colours[5] }, showlegend: false, hoverinfo: "skip" });
    const named = [...lines.map((one) => ({ x: one.flow[one.flow.length - 1], y: one.ratio[one.ratio.length - 1], yshift: -9, text: `${one.krpm}`, colour: look.muted })),
      ...islands.map((island) => ({ x: island.flow[island.flow.length - 1], y: island.ratio[island.ratio.length - 1], yshift: 0, text: `${Math.round(100 * island.level)} %`, colour: look.colours[3] })),
      ...at.map((n, k) => ({ x: c.flow[n], y: c.ratio[n], xshift: 17, yshift: -10, text: `${data.marked[k]} s`, colour: look.colours[5] }))];
    const most = Math.max(...c.ratio, ...lines[lines.length - 1].ratio);
    return { data: traces, layout: layout(look, width, { hovermode: "closest", margin: { l: 58, r: 14, t: 12, b: 48 },
      annotations: named.map(({ x, y, xshift = 0, yshift, text, colour }) => ({ x, y, xshift, yshift, text, showarrow: false, font: { size: 10.5, color: colour }, bgcolor: `${look.paper}cc` })),
      xaxis: axis(look, "corrected flow (g/s)", { rangemode: "tozero", zeroline: false }), yaxis: axis(look, "pressure ratio (–)", { range: [0.93, most * 1.03], zeroline: false }) }) };
  }

  function torque(look, width) {
    const { full_load: f } = data, traces = data.cases.map((c, n) => {
      const end = c.t.findIndex((t) => t > LAST_S), until = end < 0 ? c.t.length : end;
      return line(c.rpm.slice(0, until), c.torque.slice(0, until), plain(c.label), n === 0 ? look.ink : of(look, n - 1), { line: { dash: DASHES[n % DASHES.length], width: n === 0 ? 2.4 : 1.5 } });
    });
    traces.push(line(f.rpm, f.file, "full load of the file", look.colours[1], { line: { width: 2.2 } }));
    traces.push({ ...line(f.rpm, f.settled, "settled", look.colours[1]), mode: "markers", marker: { size: 9, color: look.colours[1], symbol: "circle-open" } });
    return { data: traces, layout: layout(look, width, { hovermode: "closest", margin: { l: 58, r: 14, t: 12, b: 48 },
      xaxis: axis(look, "engine speed (1/min)", { zeroline: false }), yaxis: axis(look, "torque (Nm)", { rangemode: "tozero" }) }) };
  }

  function filled(look, width) {
    const helped = data.cases.find((c) => c.assist.some((value) => value > 0)) ?? data.cases[0], base = data.cases[0], own = {
      yaxis: axis(look, "torque (Nm)", { domain: [0.46, 1], anchor: "x", rangemode: "tozero" }), yaxis2: axis(look, "acceleration (m/s²)", { domain: [0, 0.4], anchor: "x", rangemode: "tozero" }),
      xaxis: axis(look, "time after the pedal begins to move (s)", { range: [0, LAST_S], anchor: "y2", zeroline: false }) };
    const area = (y, name, hue) => ({ type: "scatter", mode: "lines", stackgroup: "one", x: helped.t, y, name, line: { width: 0.8, color: look.colours[hue] }, fillcolor: `${look.colours[hue]}99`, hovertemplate: `${name} %{y:.0f} Nm<extra></extra>` });
    const traces = [area(helped.torque, "engine", 5), area(helped.assist, "machine", 3), line(helped.t, helped.full, "full load", look.ink, { ...dashed }),
      line(base.t, base.accel, "without the machine", look.colours[5], { yaxis: "y2" }), line(helped.t, helped.accel, "with the machine", look.colours[3], { yaxis: "y2" }), line(helped.t, helped.map, "steady map", look.ink, { yaxis: "y2", ...dashed })];
    return { data: traces, layout: layout(look, width, { ...own, hovermode: "x unified", margin: { l: 58, r: 14, t: 12, b: 46 } }) };
  }

  Page.start((found) => {
    data = found;
    figure("time", time);
    if (data.groups.length) figure("overlay", overlay);
    figure("compressor", compressor);
    figure("torque", torque);
    if (data.cases.some((c) => c.assist.some((value) => value > 0))) figure("filled", filled);
    byId("case")?.addEventListener("change", (event) => {
      chosen = Number(event.target.value);
      ["time", "compressor"].forEach(draw);
      Page.say(`showing ${data.cases[chosen].label}`);
    });
  });
})();
