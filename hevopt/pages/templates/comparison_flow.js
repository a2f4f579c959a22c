"use strict";
// The energy flow of the row shown in detail, its labels clear of all lines, and what another row has beside it.

const Flow = (() => {
  const { plain, axis, layout } = Page;
  const { fixed, nameOf, narrow } = Look;
  const HUES = { Fuel: 1, Engine: 2, Motor: 5, Generator: 5, "Battery, drawn": 3, "Battery, stored": 3 };
  const KEPT = ["Road load", "Battery, stored"];
  const energyOf = (n) => Shown.results.rows[n].detail.energy;

  function sizes(links) {
    const through = (place, end) => links.filter((l) => l[end] === place).reduce((sum, l) => sum + l.energy_j, 0);
    return (place) => Math.max(through(place, "source"), through(place, "target")) / 1e3;
  }

  // Labels ----------------------------------------------------------------------------------------------------------

  // Room around a label, between two points of an outline, and how far from its place a label may lie; pixels.
  const CLEAR = 2, STEP = 3, FAR = 150;
  // A label further away than this is led to its place by a line.
  const LED = 12;
  const apart = (a, b) => a.x1 <= b.x0 || b.x1 <= a.x0 || a.y1 <= b.y0 || b.y1 <= a.y0;

  // Points along the outlines of all links, found by the cell of a grid that they lie in.
  function outlines(links) {
    const cells = new Map(), size = 8;
    for (const link of links) {
      const length = link.getTotalLength();
      for (let at = 0; at <= length; at += STEP) {
        const { x, y } = link.getPointAtLength(at), key = `${Math.floor(x / size)}|${Math.floor(y / size)}`;
        if (!cells.has(key)) cells.set(key, []);
        cells.get(key).push([x, y]);
      }
    }
    return (box) => {
      let crossed = 0;
      for (let i = Math.floor(box.x0 / size); i <= Math.floor(box.x1 / size); i++) {
        for (let j = Math.floor(box.y0 / size); j <= Math.floor(box.y1 / size); j++) {
          crossed += (cells.get(`${i}|${j}`) ?? []).filter(([x, y]) => x >= box.x0 && x <= box.x1 && y >= box.y0 && y <= box.y1).length;
        }
      }
      return crossed;
    };
  }

  function placesOf(element) {
    return [...element.querySelectorAll(".sankey-node")].map((node) => {
      const [x, y] = node.getAttribute("transform").match(/-?[\d.]+(?:e-?\d+)?/g).slice(-2).map(Number), rect = node.querySelector(".node-rect");
      return { name: node.__data__.node.customdata, x0: x, y0: y, x1: x + Number(rect.getAttribute("width")), y1: y + Number(rect.getAttribute("height")) };
    });
  }

  // Where a label of so much room may stand beside a place, the nearest first.
  function* candidates(place, wide, high) {
    const middle = (place.y0 + place.y1) / 2 - high / 2, found = [];
    for (let down = -FAR; down <= FAR; down += 4) {
      for (const right of [place.x1 + 4, place.x0 - 4 - wide, (place.x0 + place.x1 - wide) / 2, place.x1 + 24, place.x0 - 24 - wide]) {
        const box = { x0: right, x1: right + wide, y0: middle + down, y1: middle + down + high };
        const beside = Math.max(box.x0 - place.x1, place.x0 - box.x1, 0), off = Math.max(box.y0 - place.y1, place.y0 - box.y1, 0);
        if (beside || off >= CLEAR) found.push({ ...box, away: beside + 1.5 * off + 0.02 * Math.abs(down) });
      }
    }
    yield* found.sort((a, b) => a.away - b.away);
  }

  // Sources left of their places, ends right of theirs, where no line is; the others where they cross none.
  function labelled(element, look, textOf) {
    const whole = element.querySelector(".sankey"), svg = (tag, more) => {
      const made = document.createElementNS(whole.namespaceURI, tag);
      Object.entries(more).forEach(([key, value]) => made.setAttribute(key, value));
      return made;
    };
    const group = whole.appendChild(svg("g", { class: "flow-labels" })), links = energyOf(Shown.chosen).links;
    const crossed = outlines(element.querySelectorAll(".sankey-link")), places = placesOf(element), taken = [...places];
    const kindOf = ({ name }) => (!links.some((l) => l.target === name) ? 0 : !links.some((l) => l.source === name) ? 1 : 2);
    const below = [0, 0].map(() => -Infinity);
    for (const place of places.sort((a, b) => kindOf(a) - kindOf(b) || a.y0 - b.y0)) {
      const text = group.appendChild(svg("text", { class: "flow-label", "font-size": 11, fill: look.ink }));
      text.textContent = textOf(place.name);
      const { width: wide, height: high, y: above } = text.getBBox(), kind = kindOf(place);
      const box = kind < 2 ? outer(place, kind, wide, high, below) : inner(place, wide, high, crossed, taken);
      taken.push({ x0: box.x0 - CLEAR, x1: box.x1 + CLEAR, y0: box.y0 - CLEAR, y1: box.y1 + CLEAR });
      text.setAttribute("x", box.x0);
      text.setAttribute("y", box.y0 - above);
      if (kind === 2 && box.away > LED) group.insertBefore(svg("line", { class: "flow-lead", stroke: look.muted, "stroke-width": 0.7, ...lead(place, box) }), text);
      // Where no place is free the lines give way.
      if (box.hidden) group.insertBefore(svg("rect", { class: "flow-back", x: box.x0 - 1, y: box.y0, width: wide + 2, height: high, fill: look.paper }), text);
    }
  }

  // From the point of a label's edge nearest to its place, to the place.
  function lead(place, box) {
    const x2 = (place.x0 + place.x1) / 2, y2 = (place.y0 + place.y1) / 2;
    return { x1: Math.min(Math.max(x2, box.x0), box.x1), y1: Math.min(Math.max(y2, box.y0), box.y1), x2, y2 };
  }

  function outer(place, kind, wide, high, below) {
    const y0 = Math.max((place.y0 + place.y1) / 2 - high / 2, below[kind]), x0 = kind === 0 ? place.x0 - 5 - wide : place.x1 + 5;
    below[kind] = y0 + high + 1;
    return { x0, x1: x0 + wide, y0, y1: y0 + high };
  }

  function inner(place, wide, high, crossed, taken) {
    let least = null, fewest = Infinity;
    for (const box of candidates(place, wide, high)) {
      const roomy = { x0: box.x0 - CLEAR, x1: box.x1 + CLEAR, y0: box.y0 - CLEAR / 2, y1: box.y1 + CLEAR / 2 };
      if (!taken.every((other) => other === place || apart(roomy, other))) continue;
      const count = crossed(roomy);
      if (count === 0) return box;
      if (count < fewest) [least, fewest] = [box, count];
    }
    return { ...(least ?? candidates(place, wide, high).next().value), hidden: true };
  }

  // Figures ---------------------------------------------------------------------------------------------------------

  function sankey(look, width) {
    const { links, residual_j } = energyOf(Shown.chosen);
    const places = [...new Set(links.flatMap((link) => [link.source, link.target]))];
    const size = sizes(links), other = Shown.over < 0 ? null : sizes(energyOf(Shown.over).links);
    const ends = (place) => !links.some((link) => link.source === place);
    const hue = (place) => look.colours[HUES[place] ?? (ends(place) && !KEPT.includes(place) ? 0 : 4)];
    const told = (kj, sign = "") => `${sign && kj > 0 ? sign : ""}${fixed(kj, Math.abs(kj) < 10 ? 1 : 0)}`;
    const label = (place) => `${place} ${told(size(place))} kJ${other ? ` (${told(size(place) - other(place), "+")})` : ""}`;
    return {
      least: 1060, fresh: true, after: (element) => labelled(element, look, label),
      data: [{
        type: "sankey", arrangement: "fixed", valueformat: ",.1f", valuesuffix: " kJ",
        node: { label: places.map(() => ""), color: places.map(hue), customdata: places, pad: 24, thickness: 14, line: { color: look.ink, width: 0.5 }, hovertemplate: "%{customdata}: %{value}<extra></extra>" },
        link: { source: links.map((l) => places.indexOf(l.source)), target: links.map((l) => places.indexOf(l.target)), value: links.map((l) => l.energy_j / 1e3),
          color: links.map((l) => `${hue(ends(l.target) ? l.target : l.source)}66`), hovertemplate: "%{source.customdata} → %{target.customdata}<br>%{value}<extra></extra>" },
      }],
      layout: layout(look, width, { margin: { l: other ? 190 : 150, r: other ? 215 : 170, t: 18, b: 34 },
        annotations: [{ xref: "paper", yref: "paper", x: 0, y: 0, yshift: -22, yanchor: "middle", showarrow: false, text: `residual of the balance: ${residual_j === 0 ? "0" : (residual_j / 1e3).toExponential(1).replace(/-/g, "−")} kJ`, font: { size: 11, color: look.muted } }] }),
    };
  }

  // Entries of the balance in which two rows differ, the largest first; nothing where no other row is laid under.
  function differences(look, width) {
    if (Shown.over < 0) return null;
    const entries = (n) => new Map([...energyOf(n).taken, ...energyOf(n).spent].map((item) => [item.name, item.energy_j / 1e3]));
    const own = entries(Shown.chosen), other = entries(Shown.over);
    const found = [...new Set([...own.keys(), ...other.keys()])].map((name) => ({ name, own: own.get(name) ?? 0, other: other.get(name) ?? 0 }));
    const lines = found.filter((line) => Math.abs(line.own - line.other) >= 0.05).sort((a, b) => Math.abs(a.own - a.other) - Math.abs(b.own - b.other));
    return { height: 70 + 22 * Math.max(lines.length, 1), data: [{ type: "bar", orientation: "h", y: lines.map((line) => plain(line.name)), x: lines.map((line) => line.own - line.other),
      marker: { color: lines.map((line) => look.colours[line.own > line.other ? 1 : 3]), line: { color: look.ink, width: 0.6 } },
      customdata: lines.map((line) => [line.own, line.other]), hovertemplate: "%{y}: %{customdata[0]:.1f} kJ, the other %{customdata[1]:.1f} kJ<extra></extra>" }],
      layout: layout(look, width, { bargap: 0.3, margin: { l: narrow(width) ? 130 : 190, r: 16, t: 8, b: narrow(width) ? 58 : 44 },
        xaxis: axis(look, `${plain(nameOf(Shown.results.rows[Shown.chosen]))}${narrow(width) ? "<br>" : " "}less ${plain(nameOf(Shown.results.rows[Shown.over]))} (kJ)`, { zeroline: true, zerolinewidth: 1.2, fixedrange: true }),
        yaxis: axis(look, "", { ticks: "", fixedrange: true, showgrid: false, automargin: true, tickfont: { size: 11 } }) }) };
  }

  return { sankey, differences };
})();
