"use strict";
// Two rows over each other: what one costs more than the other, second by second, and a link that says "look here".

const Over = (() => {
  const { nameOf } = Look;
  // A window long enough for a stop, a launch or a slope, and short enough to look at.
  const WORST_S = 40;
  const carOf = (n) => Shown.results.cars[Shown.results.rows[n].figures.architecture];

  // Stored energy over the state of charge, J: the open-circuit voltage is linear between the curve's points.
  function storedJ(about) {
    const { battery_soc: soc, battery_v: volt, capacity_as: charge } = about, sums = [0];
    for (let i = 1; i < soc.length; i++) sums.push(sums[i - 1] + charge * (volt[i] + volt[i - 1]) / 2 * (soc[i] - soc[i - 1]));
    return (at) => {
      let i = 0;
      while (i < soc.length - 2 && at >= soc[i + 1]) i++;
      const slope = (volt[i + 1] - volt[i]) / (soc[i + 1] - soc[i]), step = at - soc[i];
      return sums[i] + charge * (volt[i] + slope * step / 2) * step;
    };
  }

  // (time + 1) fuel and weighted NOx so far, less what the energy stored since the start is worth at the optimum's price, g
  function spentG(n) {
    const car = carOf(n), trace = Shown.results.rows[n].detail.trace, weight = Shown.results.nox_weight;
    if (!car.about) return null;
    const stored = storedJ(car.about), first = stored(trace.soc[0]), spent = [0];
    let burnt = 0;
    trace.fuel_kg.forEach((kg, k) => {
      burnt += kg + weight * trace.nox_kg[k];
      spent.push(1e3 * (burnt - car.price_kgpj * (stored(trace.soc[k + 1]) - first)));
    });
    return spent;
  }

  function edges() {
    const car = carOf(Shown.chosen), last = car.time_s.length - 1;
    return [...car.time_s, car.time_s[last] + car.step_s[last]];
  }

  // (time + 1) what the row shown has cost more than the one under it, g; null where that is not known
  function excessG() {
    if (Shown.over < 0) return null;
    const [own, other] = [Shown.chosen, Shown.over].map(spentG);
    return own && other && own.length === other.length ? own.map((g, k) => g - other[k]) : null;
  }

  // The window in which most is lost: { from, to, lost }
  function worst(excess) {
    const at = edges(), end = at[at.length - 1];
    let found = { from: at[0], to: Math.min(end, at[0] + WORST_S), lost: -Infinity }, j = 0;
    for (let i = 0; i < at.length && (i === 0 || at[i] + WORST_S <= end); i++) {
      const to = Math.min(end, at[i] + WORST_S);
      while (j < at.length - 2 && at[j + 1] < to) j++;
      const then = excess[j] + (excess[j + 1] - excess[j]) * (to - at[j]) / (at[j + 1] - at[j]);
      if (then - excess[i] > found.lost) found = { from: at[i], to, lost: then - excess[i] };
    }
    return found;
  }

  // The row of least cost of the same car: what a row is laid over first.
  function optimum() {
    const cost = (f) => (f.bound_l_per_100km === null || f.gap_percent === null ? 0 : f.bound_l_per_100km * (1 + f.gap_percent / 100) - f.fuel_l_per_100km) + f.fuel_corrected_l_per_100km;
    const car = Shown.results.rows[Shown.chosen].figures.architecture;
    const rows = Shown.results.rows.map((row, n) => ({ row, n })).filter(({ row }) => row.detail && row.figures.architecture === car);
    return rows.reduce((best, own) => (cost(own.row.figures) < cost(best.row.figures) ? own : best)).n;
  }

  function facts(excess) {
    if (Shown.over < 0) return "";
    const own = nameOf(Shown.results.rows[Shown.chosen]), other = nameOf(Shown.results.rows[Shown.over]);
    if (!excess) return `${other} lies under ${own}.`;
    const whole = excess[excess.length - 1], { from, to, lost } = worst(excess);
    return `${own} costs ${Look.fixed(Math.abs(whole), 2)} g ${whole < 0 ? "less" : "more"} than ${other}, stored energy at the optimum's price; worst ${Look.fixed(to - from, 0)} s: ${Look.fixed(from, 0)} to ${Look.fixed(to, 0)} s, ${Look.fixed(lost, 2)} g.`;
  }

  // The address ---------------------------------------------------------------------------------------------------

  function write() {
    const parts = new URLSearchParams({ row: nameOf(Shown.results.rows[Shown.chosen]) });
    if (Shown.over >= 0) parts.set("over", nameOf(Shown.results.rows[Shown.over]));
    if (Shown.view) ["from", "to"].forEach((end, n) => parts.set(end, String(Number(Shown.view[n].toFixed(1)))));
    history.replaceState(null, "", `#${parts}`);
  }

  // What an address asks for: { row, over, view }, or null where it names no row of this page.
  function read() {
    const parts = new URLSearchParams(location.hash.slice(1));
    const found = (key) => Shown.results.rows.findIndex((row) => row.detail && nameOf(row) === parts.get(key));
    if (!parts.has("row") || found("row") < 0) return null;
    const view = ["from", "to"].map((end) => (parts.get(end) ? Number(parts.get(end)) : NaN));
    return { row: found("row"), over: parts.has("over") ? found("over") : -1, view: view.every(Number.isFinite) ? view : null };
  }

  return { carOf, excessG, worst, optimum, facts, write, read };
})();
