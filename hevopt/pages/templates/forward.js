"use strict";
// The figures of a forward run: everything over time, and where the energy went.

(() => {
  const { axis, layout, figure, plain } = Page;
  const CAUSES = { launch: 5, change: 1, start: 3, other: 0, converter: 2 };
  let data;

  const line = (y, name, colour, more = {}) => ({ type: "scatter", mode: "lines", x: data.t, y, name, hovertemplate: `${name}: %{y:.4~g}<extra></extra>`, ...more, line: { color: colour, width: 1.4, ...more.line } });
  const stepped = { line: { shape: "hv" } };

  // Panels below each other with one time axis: [title, share of the height, lines, more for the axis].
  function panels(look) {
    const c = look.colours;
    return [
      ["speed (km/h)", 2.4, [
        line(data.low, "lower end", c[0], { line: { width: 0 }, hoverinfo: "skip" }),
        line(data.high, "tolerance", c[0], { fill: "tonexty", fillcolor: `${c[0]}55`, line: { width: 0 }, hoverinfo: "skip" }),
        line(data.wanted, "wanted", look.muted, { line: { dash: "dot" } }), line(data.speed, "driven", c[5])]],
      ["gear", 0.8, [line(data.gear, "gear", c[5], stepped)], { dtick: 1 }],
      ["engine<br>(1/min)", 1, [line(data.rpm, "engine", c[5])]],
      ["torque<br>(Nm)", 1.3, [line(data.engine, "engine", c[5]), ...data.machines.map(([name, torque], n) => line(torque, name, c[[3, 1, 2][n % 3]]))]],
      ["clutch loss<br>(kW)", 1, Object.entries(CAUSES).filter(([name]) => data.clutch[name]).map(([name, hue]) => line(data.clutch[name], name, c[hue]))],
      ["brakes<br>(kW)", 0.8, [line(data.brakes, "friction brakes", c[1])]],
      ["SOC (%)", 1.3, [line(data.plan, "backward", look.muted, { line: { dash: "dash" } }), line(data.soc, "driven", c[3])]],
    ];
  }

  function trace(look, width) {
    const rows = panels(look), gap = 0.016, whole = rows.reduce((sum, row) => sum + row[1], 0);
    const own = {}, traces = [], notes = [];
    let top = 1;
    rows.forEach(([title, share, lines, more = {}], n) => {
      const key = n === 0 ? "" : String(n + 1), high = (1 - gap * (rows.length - 1)) * share / whole;
      own[`yaxis${key}`] = axis(look, title, { domain: [Math.max(top - high, 0), top], anchor: "x", nticks: 5, zeroline: false, title: { text: title, font: { size: 11 }, standoff: 4 }, ...more });
      const named = lines.filter((one) => one.name !== "lower end");
      named.forEach((one, k) => notes.push({ xref: "paper", x: 1.006, xanchor: "left", yref: "paper", y: top - 0.003 - 0.0155 * k, yanchor: "top", showarrow: false, text: one.name, font: { size: 11, color: one.name === "tolerance" ? look.muted : one.line.color } }));
      lines.forEach((one) => traces.push({ ...one, yaxis: `y${key}`, showlegend: false }));
      top -= high + gap;
    });
    const shapes = data.outside.map(([x0, x1]) => ({ type: "rect", x0, x1, yref: "paper", y0: 0, y1: 1, fillcolor: `${look.colours[1]}44`, line: { width: 0 }, layer: "below" }));
    return { data: traces, least: 560, layout: layout(look, width, { ...own, shapes, annotations: notes, hovermode: "x", margin: { l: 62, r: 96, t: 10, b: 44 },
      xaxis: axis(look, "time (s)", { anchor: `y${rows.length}`, zeroline: false }) }) };
  }

  function audit(look, width) {
    const rows = data.audit.filter(([, kj]) => Math.abs(kj) > 0.0005).sort((a, b) => a[1] - b[1]).reverse();
    const most = Math.max(...rows.map(([, kj]) => Math.abs(kj)));
    return { data: [{ type: "bar", orientation: "h", y: rows.map(([name]) => plain(name)), x: rows.map(([, kj]) => kj), marker: { color: rows.map(([, kj]) => look.colours[kj > 0 ? 3 : 5]) },
      text: rows.map(([, kj]) => kj.toFixed(1).replace("-", "−")), textposition: "outside", cliponaxis: false, hovertemplate: "%{y}: %{x:.2f} kJ<extra></extra>" }],
      least: 480, layout: layout(look, width, { margin: { l: 10, r: 60, t: 10, b: 44 }, showlegend: false,
        xaxis: axis(look, "energy (kJ)", { range: [-1.2 * most, 1.2 * most], exponentformat: "none", separatethousands: false, nticks: 6 }), yaxis: axis(look, "", { autorange: "reversed", ticks: "" }) }) };
  }

  Page.start((found) => {
    data = found;
    figure("trace", trace);
    figure("audit", audit);
  });
})();
