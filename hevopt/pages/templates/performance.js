"use strict";
// The figures of how fast cars are: the pull from rest, and forces over speed.

(() => {
  const { byId, axis, layout, figure, draw, plain } = Page;
  const HUES = [5, 1, 3, 6, 2, 4, 8, 7, 0];
  const SPEED_MAX = 240, LABEL_SHARE = 0.042; // km/h; height of a label by that of the figure
  let data, chosen = 0;

  const of = (look, n) => look.colours[HUES[n % HUES.length]];
  const line = (x, y, name, colour, more = {}) => ({ type: "scatter", mode: "lines", x, y, name, hovertemplate: `${name}: %{y:.3~f}<extra></extra>`, ...more, line: { color: colour, width: 1.7, ...more.line } });

  function pull(look, width) {
    const traces = [];
    data.cars.forEach((car, n) => {
      const last = car.t.findIndex((t) => t > 40), until = last < 0 ? car.t.length : last, t = car.t.slice(0, until);
      traces.push(line(t, car.kmh.slice(0, until), plain(car.name), of(look, n), { customdata: car.gear, hovertemplate: `${plain(car.name)}: %{y:.1f} km/h in gear %{customdata}<extra></extra>` }));
      traces.push(line(t, car.accel.slice(0, until), plain(car.name), of(look, n), { yaxis: "y2", showlegend: false, line: { width: 1.1 } }));
    });
    return { data: traces, layout: layout(look, width, { hovermode: "x", margin: { l: 58, r: 14, t: 12, b: 46 },
      yaxis: axis(look, "speed (km/h)", { domain: [0.42, 1], anchor: "x", rangemode: "tozero" }), yaxis2: axis(look, "acceleration (m/s²)", { domain: [0, 0.36], anchor: "x" }),
      xaxis: axis(look, "time (s)", { anchor: "y2", rangemode: "tozero", zeroline: false }) }) };
  }

  // Where on a slope's line its name, on it, is crossed by no other line, as far to the right as there is such a place; -1: nowhere.
  function clear(car, force, most, width) {
    const last = SPEED_MAX * (1 - 18 / (width - 72)), half = 18 * SPEED_MAX / (width - 72);
    const others = [...car.forces, ...car.against.map(([, other]) => other).filter((other) => other !== force), car.speed.map(() => car.grip)];
    for (let at = force.length - 1; at > 0; at -= 1) {
      const low = force[at] - LABEL_SHARE * most / 2, high = low + LABEL_SHARE * most;
      if (car.speed[at] > last || high > most) continue;
      const near = (n) => Math.abs(car.speed[n] - car.speed[at]) <= half;
      if (others.every((other) => other.every((value, n) => value === null || !near(n) || value < low || value > high))) return at;
    }
    return -1;
  }

  function forces(look, width) {
    const car = data.cars[chosen], traces = [], notes = [];
    car.forces.forEach((force, n) => traces.push(line(car.speed, force, `gear ${n + 1}`, of(look, n), { line: { width: 2 } })));
    const most = 1.06 * Math.max(car.grip, ...car.forces.flat().filter((value) => value !== null));
    car.against.forEach(([slope, force]) => {
      traces.push(line(car.speed, force, `${100 * slope} %`, look.muted, { showlegend: false, line: { width: 1 } }));
      const at = clear(car, force, most, width);
      if (at >= 0) notes.push({ x: car.speed[at], y: force[at], text: `${100 * slope} %`, showarrow: false, bgcolor: look.paper, borderpad: 0, font: { size: 11, color: look.muted } });
    });
    traces.push(line([car.speed[0], car.speed[car.speed.length - 1]], [car.grip, car.grip], "grip", look.ink, { line: { dash: "dash", width: 1.2 } }));
    return { data: traces, layout: layout(look, width, { hovermode: "closest", annotations: notes, margin: { l: 58, r: 14, t: 12, b: 46 },
      xaxis: axis(look, "speed (km/h)", { range: [0, SPEED_MAX], zeroline: false }), yaxis: axis(look, "force at the tyres (kN)", { range: [0, most] }) }) };
  }

  Page.start((found) => {
    data = found;
    figure("pull", pull);
    figure("forces", forces);
    byId("car")?.addEventListener("change", (event) => {
      chosen = Number(event.target.value);
      draw("forces");
      Page.say(`showing ${data.cars[chosen].name}`);
    });
  });
})();
