"""What a comparison says in two sentences."""

from math import inf

from hevopt.bounds.claim import Scope
from hevopt.pages.comparison.results import Results, RowFigures
from hevopt.pages.render import fixed
from hevopt.studies.rows import end_asked_text, marked

# Rows that differ by less than this are called equal.
_EQUAL_PERCENT = 0.05
_NOTHING_L_PER_100KM = 1e-9
# The strategy of cars that leave no choice.
_NO_CHOICE = "baseline"
# No line ends between a number and its unit.
_PERCENT = "\u00a0%"
_VOLUME = "\u00a0l/100\u00a0km"


def all_electric(results: Results) -> bool:
    """Whether no car of it has an engine."""
    solved = [row.figures for row in results.rows if row.detail is not None]
    return bool(solved) and all(row.electric for row in solved)


def corrected_cost(row: RowFigures) -> float | None:
    """Objective of a row as fuel volume, charge-corrected: l/100 km of fuel and weighted NOx."""
    if row.fuel_corrected_l_per_100km is None or row.fuel_l_per_100km is None:
        return None
    return cost(row) - row.fuel_l_per_100km + row.fuel_corrected_l_per_100km


def cost(row: RowFigures) -> float:
    """Objective of a row as fuel volume, as driven: what its gap is measured on."""
    if row.bound_l_per_100km is None or row.gap_percent is None:
        return row.fuel_l_per_100km or 0.0
    return row.bound_l_per_100km * (1 + row.gap_percent / 100)


def _corrected(row: RowFigures) -> float:
    """`corrected_cost` of a row that was solved, and so has one."""
    found = corrected_cost(row)
    return inf if found is None else found


def is_nothing(row: RowFigures) -> bool:
    """Whether a row's objective is 0, as on a trip driven on electricity alone."""
    return cost(row) < _NOTHING_L_PER_100KM


def reference_row(results: Results) -> RowFigures | None:
    """The row that all changes are against."""
    rows = (row.figures for row in results.rows)
    return next((row for row in rows if _name(row) == results.reference), None)


def _name(row: RowFigures) -> str:
    return f"{row.architecture} {row.strategy}"


def best_rows(results: Results) -> list[RowFigures]:
    """The rows of least charge-corrected cost, equal within rounding of the problem; the most neutral first.

    Rows without alerts, or, where there are none, any that were solved.
    """
    solved = [row.figures for row in results.rows if row.detail is not None]
    rows = [row for row in solved if row.status.ok] or solved
    if not rows:
        return []
    if all_electric(results):
        return sorted(rows, key=lambda row: row.electricity_kwh_per_100km or 0.0)
    near = (1 + _EQUAL_PERCENT / 100) * min(map(_corrected, rows))
    equal = [row for row in rows if _corrected(row) <= near]
    return sorted(equal, key=lambda row: (abs(row.delta_energy_percent or 0.0), cost(row)))


def verdict(results: Results) -> list[str]:
    """The best row and what it saves; how close it is to the proven bound; the best that knows no future.

    One more sentence where another end charge than the start's is asked.
    """
    equal = best_rows(results)
    if not equal:
        return ["No case could be solved on this cycle.", "The reasons are listed below."]
    if all_electric(results):
        return _electric(results, equal[0])
    return [
        _first(results, equal[0], equal[1:]),
        _second(results, equal[0]),
        *_causal(results, equal),
        *charge_asked(results),
    ]


def _electric(results: Results, best: RowFigures) -> list[str]:
    """The row that takes least from the battery, where no car has an engine."""
    said = [
        f"On {results.cycle}, {best.architecture} with {best.strategy} takes the least from its battery: "
        f"{fixed(best.electricity_kwh_per_100km, '.2f')}\u00a0kWh/100\u00a0km."
    ]
    if best.gap_percent is not None:
        said.append(
            f"What its battery gives lies {max(best.gap_percent, 0.0):.3f}{_PERCENT} above a proven lower bound."
        )
    return said


def _first(results: Results, best: RowFigures, equal: list[RowFigures]) -> str:
    what, volume = "fuel", _VOLUME
    if results.nox_weight:
        what = f"fuel plus {results.nox_weight:g} times NOx"
        volume = f"{_VOLUME} as fuel volume"
    others = ", ".join(map(_name, equal))
    also = f" (equal within {_EQUAL_PERCENT:g}{_PERCENT}: {others})" if others else ""
    doubt = "" if best.status.ok else "; no row is free of alerts, see below"
    return (
        f"On {results.cycle}, {best.architecture} with {best.strategy} needs the least {what}{also}: "
        f"{_corrected(best):.4f}{volume}, charge-corrected ({_as_driven(results, best)})"
        f"{_change(results, best)}{doubt}."
    )


def _as_driven(results: Results, row: RowFigures) -> str:
    """Fuel, CO2 and NOx of a row; with a weight on NOx, their own changes, which are not the sum's."""

    def own(percent: float | None) -> str:
        shown = results.nox_weight and percent is not None and _name(row) != results.reference
        return f" ({fixed(percent, '+.1f')}{_PERCENT})" if shown else ""

    nox = "NOx unknown"
    if row.nox_mg_per_km is not None:
        nox = f"{row.nox_mg_per_km:.0f}\u00a0mg NOx/km{own(row.delta_nox_percent)}"
    return (
        f"as driven: fuel {row.fuel_l_per_100km:.4f}{_VOLUME}{own(row.delta_fuel_percent)}, "
        f"{row.co2_g_per_km:.1f}\u00a0g CO2/km, {nox}"
    )


def _change(results: Results, best: RowFigures) -> str:
    """The change of what is ranked, against the reference."""
    base = reference_row(results)
    if base is None or base.fuel_l_per_100km is None:
        return ""
    if base is best:
        return ", itself the reference of all changes"
    summed = best.gap_percent is not None and base.gap_percent is not None
    whole = _corrected(base)
    if whole < _NOTHING_L_PER_100KM or (results.nox_weight and not summed):
        return ""
    percent = 100 * (_corrected(best) / whole - 1)
    less = "less" if percent <= 0 else "more"
    return (
        f", {abs(percent):.1f}{_PERCENT} {less} than {results.reference}{marked(base.status)} "
        "(both charge-corrected)"
    )


def _second(results: Results, best: RowFigures) -> str:
    if best.gap_percent is None or best.bound_l_per_100km is None:
        if best.bound_l_per_100km is None:
            return "There is no bound to hold it against."
        if is_nothing(best):
            return "It cannot be lower: nothing is burnt, and 0 is the bound."
        return "The proven lower bound is 0: how close to it the row could come is not known."
    proof = "" if best.certificate is None else best.certificate.proof
    scope = "among the tabulated controls"
    if best.certificate is not None and best.certificate.scope == Scope.CONTINUOUS:
        scope = "at or between the levels of its torques"
    sum_of = " of that sum" if results.nox_weight else ""
    return (
        f"As driven it lies {max(best.gap_percent, 0.0):.3f}{_PERCENT} above a proven lower bound ({proof}): no "
        f"use of engine, machine and gears {scope} takes {best.architecture} below "
        f"{best.bound_l_per_100km:.4f}{_VOLUME}{sum_of} with the same charge at the end."
    )


def _causal(results: Results, equal: list[RowFigures]) -> list[str]:
    """The best row that decides without knowing the rest of the cycle, beside the best of all."""
    rows = [row.figures for row in results.rows if row.detail is not None]
    causal = [row for row in rows if row.strategy in results.causal]
    # Where there is nothing to decide, nothing need be known.
    deciding = [row for row in causal if row.strategy != _NO_CHOICE or row in equal]
    if causal and not deciding:
        return [
            "No strategy here that has a choice is causal, deciding without knowing the rest of the cycle; "
            "hevopt strategies lists those that are."
        ]
    causal = [row for row in deciding if not (row.status.others or row.status.shortfall_steps)]
    if not causal:
        return []
    own = min(causal, key=_corrected)
    if any(own is row for row in equal):
        also = "It" if own is equal[0] else _name(own)
        return [f"{also} is causal: it decides without knowing the rest of the cycle."]
    there = f"{_above(own, equal[0])} above {_name(equal[0])}"
    least = min((r for r in rows if r.architecture == own.architecture), key=_corrected)
    if own.architecture != equal[0].architecture and least is not own:
        there += f" and {_above(own, least)} above the least of {own.architecture}, {_name(least)}"
    named = f"{_name(own)}{marked(own.status)}"
    return [
        f"The best causal strategy, one that does not know the rest of the cycle, is {named}: "
        f"{_corrected(own):.4f}{_VOLUME}, {there}."
    ]


def _above(row: RowFigures, other: RowFigures) -> str:
    least = _corrected(other)
    if least < _NOTHING_L_PER_100KM:
        return f"{_corrected(row) - least:.3f}{_VOLUME}"
    return f"{100 * (_corrected(row) / least - 1):.1f}{_PERCENT}"


def charge_asked(results: Results) -> list[str]:
    """What an asked end charge other than the start's means for the figures; nothing where none is asked."""
    if not results.end_asked:
        return []
    return [
        f"The state of charge asked at the end is not the start's: {end_asked_text(results.end_asked)}; "
        "electricity drawn from the battery down to it, or stored up to it, is not counted as fuel, nor in "
        "any change."
    ]
