"use strict";
// Measured and computed fuel of the real cars, one line each.

(() => {
  const { plain, axis, layout, figure } = Page;
  const KINDS = [
    ["bound", "bound", 3, "line-ns-open"], ["rule", "best rule", 2, "circle-open"], ["causal", "best causal strategy", 5, "circle"],
    ["measured", "measured", 1, "diamond-open"], ["warm", "measured, warm", 1, "diamond"],
  ];

  let data;

  function fuel(look, width) {
    const names = data.map((one) => plain(one.name));
    const traces = KINDS.map(([key, name, hue, symbol]) => ({
      type: "scatter", mode: "markers", name, x: data.map((one) => one[key]), y: names,
      marker: { symbol, size: 10, color: look.colours[hue], line: { width: 2, color: look.colours[hue] } }, hovertemplate: `%{y}: ${name} %{x:.3f} l/100 km<extra></extra>`,
    }));
    return { data: traces, least: 560, layout: layout(look, width, {
      hovermode: "closest", margin: { l: 12, r: 14, t: 12, b: 46 },
      xaxis: axis(look, "fuel (l/100 km)", { zeroline: false }), yaxis: axis(look, "", { autorange: "reversed", automargin: true }),
    }) };
  }

  Page.start((found) => {
    data = found;
    figure("fuel", fuel);
  });
})();
