"""What a reader must know before believing a comparison."""

from itertools import groupby
from math import inf

from hevopt.pages.alert import Alert
from hevopt.pages.comparison.results import Results, RowFigures
from hevopt.pages.comparison.saved_car import CarFigures
from hevopt.pages.comparison.verdict import is_nothing
from hevopt.pages.render import fixed
from hevopt.studies.status import Mark

LOOSE_PERCENT = 0.2
_STEPS_LISTED = 5
# A spell of the engine below this is one that no driver would accept [E].
SHORT_S = 3.0
_ROWS_LISTED = 5
# What the marks say of the charge at the end.
_CHARGES = {
    Mark.NOT_NEUTRAL: "stored energy changes",
    Mark.CHARGE_MISSED: "the charge asked at the end is missed",
    Mark.CHARGE_ABOVE: "the charge at the end is above that asked",
}


def alerts(results: Results) -> list[Alert]:
    """The checks, in the order of a reader's doubts; each speaks also where there is nothing to say."""
    checks = (_steps, _neutral, _limits, _spells, _loose, _solver)
    return [check(results) for check in checks]


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
    lines = [
        f"{row.architecture} {row.strategy}: {said}."
        for row in (row.figures for row in results.rows)
        for said in ([_charge(row)] if row.status.charge else []) + list(row.status.others)
    ]
    asked = "the charge asked" if results.end_asked else "the charge it started with"
    nothing = f"Every row that was solved ends with {asked}, within 1 % of the fuel's energy."
    return Alert("Charge balance", bool(lines), lines or [nothing])


def _charge(row: RowFigures) -> str:
    """What a row's mark says of the charge at the end."""
    share = "while no fuel is burnt"
    if row.delta_energy_percent is not None:
        share = f"by {fixed(row.delta_energy_percent, '+.2f')} % of the fuel's energy"
    return f"{_CHARGES[row.status.charge]} {share}; compare the corrected figure"


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


def _spells(results: Results) -> Alert:
    """Spells of the engine, on or off, that end sooner than a driver would have them."""
    found = []
    for row in results.rows:
        if row.detail is None:
            continue
        step_s = results.cars[row.figures.architecture].step_s
        inner = _inner_spells(row.detail.trace.engine_speed_radps, step_s)
        sides = (("off", [s for on, s in inner if not on]), ("on", [s for on, s in inner if on]))
        short = [(min(of), side) for side, of in sides if min(of, default=inf) < SHORT_S]
        if short:
            told = ", ".join(f"shortest {side} {s:g} s" for s, side in short)
            name = f"{row.figures.architecture} {row.figures.strategy}"
            found.append((min(short), f"{name}: {row.figures.engine_starts} starts, {told}."))
    found.sort(key=lambda entry: entry[0])
    lines = [line for _, line in found[:_ROWS_LISTED]]
    if len(found) > _ROWS_LISTED:
        lines.append(f"And {len(found) - _ROWS_LISTED} more; see Operation.")
    nothing = f"No row turns the engine on or off for less than {SHORT_S:g} s."
    return Alert("Short spells of the engine", bool(lines), lines or [nothing], grave=False)


def _inner_spells(speed_radps: list[float], step_s: list[float]) -> list[tuple[bool, float]]:
    """Whether the engine turns, and for how long, of all spells but those that the cycle's ends cut off."""
    steps = zip((speed > 0 for speed in speed_radps), step_s, strict=True)
    spells = [(on, sum(s for _, s in own)) for on, own in groupby(steps, lambda step: step[0])]
    return spells[1:-1]


def _loose(results: Results) -> Alert:
    gaps = {name: car.certified_gap_percent for name, car in results.cars.items()}
    known = {name: gap for name, gap in gaps.items() if gap is not None}
    loose = [
        f"{name}: dynamic programming lies {gap:.2f} % above the bound; how much of it is slack is not known."
        for name, gap in known.items()
        if gap > LOOSE_PERCENT
    ]
    lost = [f"{which}: tried and not found: {why}." for which, why in results.lost_proofs.items()]
    least = {name: _burns_nothing(results, name) for name in gaps if name not in known}
    none = [
        f"{name}: the bound is 0; it holds nothing." for name, is_0 in least.items() if not is_0
    ]
    if not gaps:
        none = ["There is no certificate."]
    tight = [
        f"{name}: cannot be lower than the 0 that it burns." for name, is_0 in least.items() if is_0
    ]
    widest = max(known, key=known.get, default=None)
    if widest is not None and not loose:
        tight.append(
            f"Optimum and bound are at most {max(known[widest], 0.0):.3f} % apart ({widest}); "
            f"loose would be {LOOSE_PERCENT:g} %."
        )
    return Alert(
        "Certificates", bool(loose or lost or none), loose + lost + none + tight, grave=bool(loose)
    )


def _burns_nothing(results: Results, car: str) -> bool:
    """Whether a row of the car has an objective of 0, which no proof need undercut."""
    rows = [row.figures for row in results.rows if row.detail and row.figures.architecture == car]
    return any(is_nothing(row) for row in rows)


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
    lines += [
        f"{row.figures.architecture} {row.figures.strategy}: {row.figures.status}."
        for row in results.rows
        if row.detail is None
        and not {row.figures.architecture, f"{row.figures.architecture} {row.figures.strategy}"}
        & set(results.failures)
    ]
    return Alert("Solvers", bool(lines), lines or ["Every case was solved, none with a warning."])
