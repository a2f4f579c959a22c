"""What a comparison says in two sentences, and what a reader must know before believing it."""

from dataclasses import dataclass

from hevopt.pages.results import CarFigures, Results, RowFigures

LOOSE_PERCENT = 0.2
# Rows that differ by less than this are called equal.
_EQUAL_PERCENT = 0.05
_STEPS_LISTED = 5


@dataclass(frozen=True, slots=True)
class Alert:
    """One thing to check: its name, whether there is something to say, and what, line by line.

    grave: what puts figures in doubt, rather than what only deserves a look
    """

    name: str
    found: bool
    lines: list[str]
    grave: bool = True


def corrected_cost(row: RowFigures) -> float | None:
    """Objective of a row as fuel volume, charge-corrected: l/100 km of fuel and weighted NOx."""
    if row.fuel_corrected_l_per_100km is None:
        return None
    return cost(row) - row.fuel_l_per_100km + row.fuel_corrected_l_per_100km


def cost(row: RowFigures) -> float:
    """Objective of a row as fuel volume, as driven: what its gap is measured on."""
    if row.bound_l_per_100km is None or row.gap_percent is None:
        return row.fuel_l_per_100km
    return row.bound_l_per_100km * (1 + row.gap_percent / 100)


def best_rows(results: Results) -> list[RowFigures]:
    """The rows of least charge-corrected cost, equal within rounding of the problem; the most neutral first.

    Rows without alerts, or, where there are none, any that were solved.
    """
    solved = [row.figures for row in results.rows if row.detail is not None]
    rows = [row for row in solved if row.status == "ok"] or solved
    if not rows:
        return []
    near = (1 + _EQUAL_PERCENT / 100) * min(map(corrected_cost, rows))
    equal = [row for row in rows if corrected_cost(row) <= near]
    return sorted(equal, key=lambda row: (abs(row.delta_energy_percent or 0.0), cost(row)))


def verdict(results: Results) -> list[str]:
    """Two sentences: the best row and what it saves; how close it is to the proven bound."""
    equal = best_rows(results)
    if not equal:
        return ["No case could be solved on this cycle.", "The reasons are listed below."]
    return [_first(results, equal[0], equal[1:]), _second(results, equal[0])]


def _first(results: Results, best: RowFigures, equal: list[RowFigures]) -> str:
    what, sum_of = "fuel", ""
    if results.nox_weight:
        what = f"fuel plus {results.nox_weight:g} times NOx"
        sum_of = f"{cost(best):.4f} l/100 km as fuel volume, of which fuel "
    others = ", ".join(f"{row.architecture} {row.strategy}" for row in equal)
    also = f" (equal within {_EQUAL_PERCENT:g} %: {others})" if others else ""
    change = ""
    if f"{best.architecture} {best.strategy}" == results.reference:
        change = ", itself the reference of all changes"
    elif best.delta_fuel_percent is not None:
        less = "less" if best.delta_fuel_percent <= 0 else "more"
        change = f", {abs(best.delta_fuel_percent):.1f} % {less} than {results.reference}"
    doubt = "" if best.status == "ok" else "; no row is free of alerts, see below"
    known = best.nox_mg_per_km is not None
    nox = f"{best.nox_mg_per_km:.0f} mg NOx/km" if known else "NOx unknown"
    return (
        f"On {results.cycle}, {best.architecture} with {best.strategy} needs the least {what}{also}: {sum_of}"
        f"{best.fuel_l_per_100km:.4f} l/100 km ({best.co2_g_per_km:.1f} g CO2/km, {nox}){change}{doubt}."
    )


def _second(results: Results, best: RowFigures) -> str:
    if best.gap_percent is None:
        return "There is no bound to hold it against."
    proof = (best.certificate or "").split(",")[0]
    sum_of = " of that sum" if results.nox_weight else ""
    return (
        f"It lies {max(best.gap_percent, 0.0):.3f} % above a proven lower bound ({proof}): no use of engine, "
        f"machine and gears among the tabulated controls takes {best.architecture} below "
        f"{best.bound_l_per_100km:.4f} l/100 km{sum_of} with the same charge at the end."
    )


def alerts(results: Results) -> list[Alert]:
    """The five checks, in the order of a reader's doubts; each speaks also where there is nothing to say."""
    return [_steps(results), _neutral(results), _limits(results), _loose(results), _solver(results)]


def _steps(results: Results) -> Alert:
    lines = [
        line for name, car in results.cars.items() if (line := _missing(name, car)) is not None
    ]
    unsolved = dict.fromkeys(
        row.figures.architecture
        for row in results.rows
        if row.figures.architecture not in results.cars
    )
    lines += [f"{name}: no result; see Solvers." for name in unsolved]
    return Alert("Steps not followed", bool(lines), lines or ["Every car follows every step."])


def _missing(name: str, car: CarFigures) -> str | None:
    short = [(t, nm) for t, nm in zip(car.time_s, car.missing_torque_nm, strict=True) if nm > 0]
    if not short:
        return None
    at = ", ".join(f"{t:g} s" for t, _ in short[:_STEPS_LISTED])
    more = f" and {len(short) - _STEPS_LISTED} more" if len(short) > _STEPS_LISTED else ""
    return (
        f"{name}: {len(short)} of {len(car.time_s)} steps, up to {max(nm for _, nm in short):.0f} Nm short at "
        f"the wheels (at {at}{more}); driven with what there is."
    )


def _neutral(results: Results) -> Alert:
    lines = []
    for row in (row.figures for row in results.rows if "not neutral" in row.figures.status):
        share = "while no fuel is burnt"
        if row.delta_energy_percent is not None:
            change = f"{row.delta_energy_percent:+.2f} %".replace("-", "−")
            share = f"by {change} of the fuel's energy"
        lines.append(
            f"{row.architecture} {row.strategy}: stored energy changes {share}; compare the corrected figure."
        )
    nothing = "Every row that was solved ends with its charge within 1 % of the fuel's energy."
    return Alert("Charge balance", bool(lines), lines or [nothing])


def _limits(results: Results) -> Alert:
    found: dict[tuple[str, str], list[str]] = {}
    for row in results.rows:
        for name, steps in (row.detail.limits if row.detail else {}).items():
            words = found.setdefault((row.figures.architecture, name), [])
            words.append(f"{steps} ({row.figures.strategy})")
    lines = [f"{car}, {name}: steps {', '.join(words)}." for (car, name), words in found.items()]
    nothing = (
        "No row comes within 1 % of full load, an edge of a map or a limit of machine and battery."
    )
    head = ["Steps within 1 % of a limit, where more of the component could change the result:"]
    return Alert(
        "Map edges and limits", bool(lines), head + lines if lines else [nothing], grave=False
    )


def _loose(results: Results) -> Alert:
    gaps = {name: car.certified_gap_percent for name, car in results.cars.items()}
    lines = [
        f"{name}: dynamic programming lies {gap:.2f} % above the bound; how much of it is slack is not known."
        for name, gap in gaps.items()
        if gap is not None and gap > LOOSE_PERCENT
    ]
    known = {name: gap for name, gap in gaps.items() if gap is not None}
    widest = max(known, key=known.get, default=None)
    tight = "There is no certificate."
    if widest is not None:
        tight = (
            f"Optimum and bound are at most {max(known[widest], 0.0):.3f} % apart ({widest}); "
            f"loose would be {LOOSE_PERCENT:g} %."
        )
    return Alert("Certificates", bool(lines), lines or [tight])


def _solver(results: Results) -> Alert:
    lines = [
        line
        for name, message in results.failures.items()
        for line in f"{name}: {message}".splitlines()
    ]
    lines += [
        f"{row.figures.architecture} {row.figures.strategy}: {trouble}."
        for row in results.rows
        if row.detail is not None
        for trouble in row.detail.solver
    ]
    return Alert("Solvers", bool(lines), lines or ["Every case was solved, none with a warning."])
