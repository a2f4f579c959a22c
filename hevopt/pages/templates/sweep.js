"use strict";
// The figures of a sweep: designs as lines, fuel against NOx, main effects.

(() => {
  const { byId, plain, axis, layout, figure, draw } = Page;
  const SYMBOLS = ["circle", "square", "diamond", "triangle-up", "x", "cross", "star", "triangle-down"];
  const HUES = [5, 1, 3, 6, 2, 4, 8, 7];
  // From blue to yellow over grey: read alike by colour-blind eyes, and lighter step by step.
  const SCALE = [[0, 32, 76], [67, 78, 108], [124, 123, 120], [188, 175, 111], [254, 232, 56]];
  const BINS = 10, NEAR = 0.3, TICK = 0.015;

  let data, chosen = 0, kept = new Map();

  const narrow = (width) => width < 560;
  const significant = (value) => String(Number(value.toPrecision(4)));
  // The middle is left out: names that belong together often differ at their ends.
  const short = (text, most) => plain(text.length > most ? `${text.slice(0, Math.ceil(most / 2))}…${text.slice(1 - Math.floor(most / 2))}` : text);
  const titled = (key, unit, log) => plain(`${key}${log ? ", log" : ""} (${unit || "–"})`);
  const dark = (look) => parseInt(look.paper.slice(1, 3), 16) < 128;

  // share 0: the best. On either paper the best stand out and the worst stay visible.
  function colour(look, share) {
    const at = (dark(look) ? 1 - 0.8 * share : 0.86 * share) * (SCALE.length - 1), n = Math.min(Math.floor(at), SCALE.length - 2);
    return `rgb(${SCALE[n].map((low, k) => Math.round(low + (at - n) * (SCALE[n + 1][k] - low))).join(",")})`;
  }

  const scaleOf = (look) => Array.from({ length: 11 }, (_, n) => [n / 10, colour(look, n / 10)]);

  function nothing(look, width) {
    const text = "no design of this NO<sub>x</sub> weight to show";
    return { height: 120, data: [], layout: layout(look, width, { xaxis: { visible: false }, yaxis: { visible: false }, annotations: [{ xref: "paper", yref: "paper", x: 0.5, y: 0.5, showarrow: false, text }] }) };
  }

  // Designs as lines ------------------------------------------------------------------------------------------------

  // The axes of the chosen weight: name, unit, values per design, their ends, where ticks stand.
  function axes() {
    const { lines } = data.groups[chosen];
    const own = data.parameters.map((p, n) => ({ ...p, values: lines.values[n] })).filter((p) => p.high > p.low && !(p.key === "nox_weight" && data.groups.length > 1));
    const figures = [["fuel", "fuel, corrected", "l/100 km"], ["nox", "NOx", "mg/km"], ["merit", data.merit, "l/100 km"]]
      .filter(([name]) => lines[name].some((value) => value !== null))
      .map(([name, key, unit]) => ({ key, unit, numeric: true, log: false, values: lines[name], low: Math.min(...lines[name]), high: Math.max(...lines[name]) }));
    return [...own, ...figures].map((a) => ({ ...a, at: placeOn(a) }));
  }

  function placeOn({ low, high, log }) {
    const f = log ? Math.log : (value) => value, span = f(high) - f(low);
    return (value) => (span > 0 ? (f(value) - f(low)) / span : 0.5);
  }

  function ticksOf(a, room) {
    if (!a.numeric) return a.names.map((name, n) => ({ y: a.at(n), text: short(name, room) }));
    const distinct = [...new Set([a.low, ...a.values, a.high])].sort((x, y) => x - y);
    const even = Array.from({ length: 5 }, (_, n) => (a.log ? a.low * (a.high / a.low) ** (n / 4) : a.low + (a.high - a.low) * n / 4));
    const ticks = [];
    for (const value of distinct.length <= 8 ? distinct : [...new Set(even)]) {
      const y = a.at(value);
      if (!ticks.length || y - ticks[ticks.length - 1].y > 0.04) ticks.push({ y, text: significant(value).replace("-", "−") });
    }
    return ticks;
  }

  function inside(all, n) {
    for (const [j, [low, high]] of kept) {
      const y = all[j].at(all[j].values[n]);
      if (y < low - 1e-9 || y > high + 1e-9) return false;
    }
    return true;
  }

  function parallel(look, width) {
    if (!data.groups[chosen].lines.design.length) {
      byId("kept").textContent = "No design is drawn.";
      return nothing(look, width);
    }
    const bare = axes(), { lines } = data.groups[chosen], count = lines.design.length, last = bare.length - 1, least = 150 + 118 * bare.length;
    // Names have the room between two axes, less that of a neighbour's figures. On paper nothing scrolls.
    const room = Math.max(6, Math.min(24, Math.floor((((width < 640 ? least : width) - 166) / Math.max(last, 1) - 48) / 6)));
    const all = bare.map((a) => ({ ...a, ticks: ticksOf(a, room) }));
    const merit = { low: Math.min(...lines.merit), high: Math.max(...lines.merit) };
    const share = (value) => (merit.high > merit.low ? (value - merit.low) / (merit.high - merit.low) : 0);
    const strands = Array.from({ length: BINS + 1 }, () => ({ x: [], y: [], text: [] }));
    let within = 0;
    for (let n = 0; n < count; n++) {
      const shown = inside(all, n), strand = strands[shown ? Math.min(Math.floor(BINS * share(lines.merit[n])), BINS - 1) : BINS];
      within += shown;
      all.forEach((a, j) => {
        strand.x.push(j); strand.y.push(a.at(a.values[n]));
        strand.text.push(`design ${lines.design[n]}<br>${data.merit} ${lines.merit[n].toFixed(4)} l/100 km`);
      });
      strand.x.push(null); strand.y.push(null); strand.text.push("");
    }
    const bundle = (strand, hue, opacity, wide) => ({ type: "scatter", mode: "lines", x: strand.x, y: strand.y, text: strand.text, hovertemplate: "%{text}<extra></extra>", showlegend: false, opacity, line: { color: hue, width: wide } });
    const faint = bundle(strands[BINS], look.rule, 0.5, 0.8);
    const traces = strands.slice(0, BINS).map((strand, n) => bundle(strand, colour(look, (n + 0.5) / BINS), count > 200 ? 0.6 : 0.9, n === 0 ? 2 : 1.3)).reverse();
    traces.push({ type: "scatter", mode: "markers", x: [null], y: [null], showlegend: false, hoverinfo: "skip", marker: { color: [merit.low], cmin: merit.low, cmax: merit.high > merit.low ? merit.high : merit.low + 1e-6, colorscale: scaleOf(look), showscale: true,
      colorbar: { title: { text: `${data.merit} (l/100 km)`, side: "right", font: { size: 11 } }, thickness: 12, len: 1, x: 1, xpad: narrow(width) ? 22 : 40, outlinewidth: 0, tickfont: { size: 11 }, tickformat: ".3f" } } });
    byId("kept").textContent = kept.size ? `${within} of ${count} drawn designs are within the ranges.` : `${count}${lines.all > count ? ` of ${lines.all}` : ""} designs are drawn.`;
    const name = (a) => `${a.key.split(".").map(plain).join(".<br>")}<br>(${plain(a.unit || "–")})${a.log ? ", log" : ""}`;
    return {
      least, data: [faint, ...traces],
      layout: layout(look, width, {
        dragmode: false, hovermode: "closest", hoverdistance: 8, margin: { l: 66, r: 100, t: 66, b: 16 },
        xaxis: { range: [-0.12, last + 0.12], visible: false, fixedrange: true, title: { text: "" } }, yaxis: { range: [-0.04, 1.04], visible: false, fixedrange: true },
        shapes: shapes(look, all),
        annotations: all.flatMap((a, j) => [
          { x: j, y: 1.04, yanchor: "bottom", showarrow: false, text: name(a), font: { size: 11, color: look.ink } },
          ...a.ticks.map((tick) => ({ x: j, y: tick.y, xanchor: "right", xshift: -4, showarrow: false, text: tick.text, font: { size: 10.5, color: look.ink }, bgcolor: `${look.paper}cc`, borderpad: 1 })),
        ]),
      }),
    };
  }

  function shapes(look, all) {
    const line = (x0, y0, x1, y1, wide) => ({ type: "line", x0, y0, x1, y1, line: { color: look.ink, width: wide } });
    return [
      ...all.flatMap((a, j) => [line(j, 0, j, 1, 1), ...a.ticks.map((tick) => line(j - TICK, tick.y, j + TICK, tick.y, 1))]),
      ...[...kept].map(([j, [low, high]]) => ({ type: "rect", x0: j - 0.05, x1: j + 0.05, y0: low, y1: high, line: { color: look.colours[1], width: 2 }, fillcolor: `${look.colours[1]}33` })),
    ];
  }

  function brush() {
    const element = byId("parallel");
    let from = null;
    const place = (event) => {
      const box = element.querySelector(".nsewdrag")?.getBoundingClientRect(), { xaxis, yaxis } = element._fullLayout;
      if (!box) return null;
      const x = xaxis.p2l(event.clientX - box.left), y = yaxis.p2l(event.clientY - box.top);
      return { j: Math.round(x), off: Math.abs(x - Math.round(x)), y: Math.min(1, Math.max(0, y)) };
    };
    element.addEventListener("pointerdown", (event) => {
      const at = place(event);
      from = at && at.off < NEAR && at.j >= 0 && at.j < axes().length ? at : null;
    });
    addEventListener("pointerup", (event) => {
      if (!from) return;
      const to = place(event), range = to && [Math.min(from.y, to.y), Math.max(from.y, to.y)];
      if (range && range[1] - range[0] > 0.01) kept.set(from.j, range);
      else kept.delete(from.j);
      from = null;
      draw("parallel");
    });
    byId("let-go").addEventListener("click", () => { kept.clear(); draw("parallel"); });
  }

  // Fuel against NOx ------------------------------------------------------------------------------------------------

  function plane(look, width) {
    const { groups, front, edge, short, pruned } = data.plane, several = groups.length > 1, traces = [];
    const points = [...groups, short, pruned].flatMap((g) => g.fuel.map((fuel, n) => [fuel, g.nox[n]])).filter(([fuel, nox]) => fuel !== null && nox !== null);
    const ends = (values, room) => { const low = Math.min(...values), high = Math.max(...values), span = high - low || 0.02 * high || 1; return [low - room * span, high + 0.05 * span]; };
    const ys = ends(points.map((p) => p[1]), 0.08);
    const steps = front.fuel.flatMap((fuel, n) => (n === 0 ? [[fuel, ys[1] * 2]] : [[fuel, front.nox[n - 1]]]).concat([[fuel, front.nox[n]]]));
    if (steps.length) steps.push([2 * Math.max(...points.map((p) => p[0])), front.nox[front.nox.length - 1]]);
    traces.push({ type: "scatter", mode: "lines", name: "front of what was found", x: steps.map((p) => p[0]), y: steps.map((p) => p[1]), line: { color: look.muted, width: 1.4, dash: "dot" }, hoverinfo: "skip" });
    // With more weights than symbols, a symbol comes again in another colour.
    const hue = (n) => look.colours[HUES[(n + Math.floor(n / SYMBOLS.length)) % HUES.length]];
    groups.forEach((g, n) => traces.push({
      type: "scatter", mode: "markers", name: several ? `NO<sub>x</sub> weight ${plain(g.label)}` : "design", x: g.fuel, y: g.nox, customdata: g.design.map((d, k) => [d, g.weight[k], g.merit[k]]),
      marker: { symbol: SYMBOLS[n % SYMBOLS.length], size: points.length > 1000 ? 5 : 8, color: hue(n), opacity: points.length > 300 ? 0.6 : 0.85, line: { color: look.paper, width: 0.5 } },
      hovertemplate: "design %{customdata[0]}, weight %{customdata[1]:.4g}<br>%{x:.4f} l/100 km, %{y:.1f} mg/km<br>objective %{customdata[2]:.4f} l/100 km<extra></extra>",
    }));
    traces.push({ type: "scatter", mode: "markers", name: "on the front", x: front.fuel, y: front.nox, hoverinfo: "skip", marker: { symbol: "circle-open", size: points.length > 1000 ? 9 : 14, color: look.ink, line: { width: 1.6 } } });
    const others = (name, g, symbol, colour, worth) => ({ type: "scatter", mode: "markers", name, x: g.fuel, y: g.nox, customdata: g.design.map((d, k) => [d, g.weight[k], g.merit[k]]), marker: { symbol, size: 8, color: colour, line: { width: 1.4, color: colour } },
      hovertemplate: `${name}: design %{customdata[0]}, weight %{customdata[1]:.4g}<br>${worth} %{customdata[2]:.4f} l/100 km<extra></extra>` });
    if (short.design.length) traces.push(others("does not follow the cycle", short, "x-thin-open", look.ink, "objective"));
    if (pruned.design.length) traces.push(others("pruned, by its bound", pruned, "circle-open", look.muted, "bound"));
    let left = Infinity;
    if (edge) {
      traces.push({ type: "scatter", mode: "lines", name: "certified boundary", x: edge.fuel, y: edge.nox, line: { color: look.ink, width: 2.4 }, hovertemplate: "no plan below %{x:.4f} l/100 km at %{y:.1f} mg/km<extra></extra>" });
      left = Math.min(...edge.fuel);
    }
    const xs = ends([...points.map((p) => p[0]), ...(left < Infinity ? [left] : [])], 0.06);
    return { data: traces, layout: layout(look, width, { hovermode: "closest", margin: { l: 62, r: 14, t: 12, b: 48 },
      xaxis: axis(look, "fuel, charge-corrected (l/100 km)", { range: xs, zeroline: false }), yaxis: axis(look, "NO<sub>x</sub> (mg/km)", { range: [Math.max(ys[0], 0), ys[1]], zeroline: false }) }) };
  }

  // Main effects ----------------------------------------------------------------------------------------------------

  // What stands at the values in order: nothing at one so near to the last that their figures would touch.
  function apart(e) {
    const places = e.values.map((value) => (e.log ? Math.log(value) : value)), room = (places[places.length - 1] - places[0]) / 8;
    let last = -Infinity;
    return e.values.map((value, k) => {
      if (places[k] - last < room) return "";
      last = places[k];
      return significant(value);
    });
  }

  // Where an axis has marks: at the values, or where there are bins at round numbers.
  function marks(e) {
    if (!e.binned && e.values.length <= 8) return { tickvals: e.values, ticktext: apart(e) };
    if (!e.log) return { nticks: 6, tickformat: "~g" };
    const round = [];
    for (let p = Math.floor(Math.log10(e.low[0])); p <= Math.log10(e.high[e.high.length - 1]); p++) round.push(...[1, 2, 5].map((m) => Number(`${m}e${p}`)));
    const shown = round.filter((value) => value >= e.low[0] * 0.99 && value <= e.high[e.high.length - 1] * 1.01);
    const few = shown.length > 6 ? shown.filter((value) => String(value).replace(/[.0]|e.*/g, "") === "1") : shown;
    return { tickvals: few, ticktext: few.map(significant) };
  }

  function effects(look, width) {
    if (!data.groups[chosen].effects.length) return nothing(look, width);
    const { effects: found } = data.groups[chosen], columns = narrow(width) ? 1 : Math.min(found.length, width < 1000 ? 2 : 3), rows = Math.ceil(found.length / columns);
    const every = found.flatMap((e) => [...(e.mean ?? []), ...e.best, ...e.floor]).filter((value) => value !== null), low = Math.min(...every), high = Math.max(...every), room = 0.07 * (high - low || 0.01 * high);
    const own = {}, traces = [];
    found.forEach((e, n) => {
      const key = n === 0 ? "" : String(n + 1), places = { xaxis: `x${key}`, yaxis: `y${key}` };
      const x = e.numeric ? e.values : e.values.map((_, k) => k);
      const ticks = e.numeric ? { type: e.log ? "log" : "linear", ...marks(e) } : { tickvals: x, ticktext: e.values.map((text) => short(text, 17)), range: [-0.5, x.length - 0.5] };
      own[`xaxis${key}`] = axis(look, titled(e.key, e.unit, e.log), { anchor: `y${key}`, zeroline: false, fixedrange: true, ...ticks });
      own[`yaxis${key}`] = axis(look, `${data.merit} (l/100 km)`, { anchor: `x${key}`, zeroline: false, fixedrange: true, range: [low - room, high + room], nticks: 6 });
      const text = e.values.map((value, k) => plain(e.binned ? `${significant(e.low[k])} to ${significant(e.high[k])}` : e.numeric ? significant(value) : value));
      const shown = [["mean", e.mean, 5, "circle", "solid"], ["best", e.best, 1, "diamond", "dash"], ["least bound of pruned", e.floor.some((value) => value !== null) && e.floor, 0, "circle-open", "none"]];
      shown.filter(([, y]) => y).forEach(([name, y, hue, symbol, dash]) => traces.push({
        type: "scatter", mode: e.numeric && dash !== "none" ? "lines+markers" : "markers", name, legendgroup: name, showlegend: n === 0, x, y, ...places, text, customdata: e.count, line: { color: look.colours[hue], width: 1.8, dash: dash === "none" ? "solid" : dash }, marker: { symbol, size: 8, color: look.colours[hue] },
        hovertemplate: `%{text}: ${name} %{y:.4f} l/100 km<br>%{customdata} solved<extra></extra>`,
      }));
    });
    return { height: 70 + 270 * rows, data: traces, layout: layout(look, width, { ...own, grid: { rows, columns, pattern: "independent", xgap: 0.2, ygap: 0.34 }, margin: { l: 62, r: 14, t: 12, b: 50 } }) };
  }

  // Choosing a weight, saving ---------------------------------------------------------------------------------------

  function choose(index) {
    chosen = index;
    kept = new Map();
    for (const select of document.querySelectorAll("select.weight")) select.value = String(index);
    ["parallel", "effects"].forEach(draw);
    Page.say(`showing NOx weight ${data.groups[index].label}`);
  }

  async function saveTable(name) {
    const stream = new Blob([Page.bytes("packed-table")]).stream().pipeThrough(new DecompressionStream("gzip"));
    Page.save(await new Response(stream).blob(), "text/csv", name);
  }

  Page.start((found) => {
    data = found;
    const some = data.groups.some((g) => g.lines.design.length);
    if (some) figure("parallel", parallel);
    else byId("parallel-section").hidden = true;
    if (data.plane) figure("plane", plane);
    figure("effects", effects);
    byId("download").addEventListener("click", (event) => saveTable(event.target.dataset.name));
    for (const select of document.querySelectorAll("select.weight")) select.addEventListener("change", () => choose(Number(select.value)));
    if (some) brush();
  });
})();
