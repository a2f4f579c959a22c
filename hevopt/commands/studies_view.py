"""What `hevopt pareto` and `sensitivity` show and write."""

from collections.abc import Sequence
from pathlib import Path

from rich import box
from rich.table import Table
from rich.text import Text

from hevopt.car.architecture import Architecture
from hevopt.driving.cycle import Cycle
from hevopt.files.frames import csv_of
from hevopt.files.writing import write_whole
from hevopt.studies.fronts import CarFront
from hevopt.studies.sensitivity import Effect, unsolved

_EFFECTS_NOTES = """fuel: charge-corrected, change against the car as given. elasticity: per cent of fuel (NOx) per
per cent of the parameter. Everything is solved afresh for each value, thresholds of rules calibrated anew. NOx is
what the plan of least fuel happens to emit, unless --nox-weight gives it a weight."""
_UNSOLVED = "-: no figure, as the car cannot be solved there:"
_NOTHING = (
    "-: no change, as the car as given burns or emits nothing, or its engine has no data on NOx."
)
SHORTFALL_NOTE = "Where the car cannot follow, each value drives on with less than the cycle asks."


def write_front(out: Path, front: CarFront) -> None:
    """Points and outer front in one table; what has no meaning for a line is empty."""
    import pandas as pd

    names = ["kind", "nox_weight", "strategy", "fuel_l_per_100km", "nox_mg_per_km", "bound_l_per_100km",
             "gap_percent", "certificate"]  # fmt: skip
    figures = front.as_dict()
    lines = [{"kind": "plan", **point} for point in figures["points"]]
    lines += [{"kind": "outer front", **corner} for corner in figures["outer"]]
    write_whole(out, csv_of(pd.DataFrame(lines, columns=names)))


def front_table(front: CarFront) -> Table:
    """The points of a front."""
    heads = ["weight\nkg/kg", "fuel\nl/100km", "NOx\nmg/km", "bound\nl/100km", "gap\n%", "proof"]
    strategy = front.points[0].strategy
    title = f"cycle {front.cycle}, {front.architecture} {strategy}: fuel against NOx"
    table = _empty(title, heads, "rrrrrl")
    for point in front.points:
        gap = point.gap_percent
        cells = [
            " to ".join(f"{weight:.4g}" for weight in _ends(point.nox_weights)),
            f"{point.fuel_l_per_100km:.3f}",
            f"{point.nox_mg_per_km:.1f}",
            f"{point.bound_l_per_100km:.3f}",
            "-" if gap is None else f"{gap:.3f}",
            point.certificate,
        ]
        table.add_row(*map(Text, cells))
    return table


def front_notes(front: CarFront, car: Architecture, *, refined: bool) -> str:
    """What the columns mean, and what the front as a whole says."""
    weights = [weight for point in front.points for weight in point.nox_weights]
    short = ""
    if front.shortfall_steps:
        short = f"\nsteps driven with less than the cycle asks: {front.shortfall_steps}."
    if refined:
        short += "\nrefined: one table for all weights, torque levels added around the plan of least fuel."
    return f"""weight: kg of fuel that a kg of NOx counts, first to last of those for which no plan found is better.
bound: no plan of its scope that ends with a state of charge of {car.soc_end:g} or more has less
fuel + weight x NOx, as fuel volume. Each bound is a half plane of the diagram; no plan lies beyond any of them.
gap: the point's own sum above its bound; charge left beyond what is asked is not credited.
{len(weights)} weights from {weights[0]:g} to {weights[-1]:.4g}: for any of them or between, the best point is
within {front.gap_percent:.3f} % of the least that the bounds leave.{short}"""


def effects_table(effects: Sequence[Effect], trace: Cycle) -> Table:
    """The effects of one strategy."""
    first = effects[0]
    heads = ["parameter", "unit", "values", "fuel\n%", "elasticity", "NOx\n%", "elasticity"]
    table = _empty(f"cycle {trace.name}, {first.architecture} {first.strategy}", heads, "llrrrrr")
    for effect in effects:
        cells = [
            effect.parameter,
            effect.unit,
            " / ".join(f"{value:.4g}" for value in effect.values),
            " / ".join(_signed(value, 2) for value in effect.delta_percent),
            _signed(effect.elasticity, 3),
            " / ".join(_signed(value, 1) for value in effect.delta_nox_percent),
            _signed(effect.elasticity_nox, 2),
        ]
        table.add_row(*map(Text, cells))
    return table


def effects_notes(effects: Sequence[Effect]) -> str:
    """What the columns mean, and why figures lack."""
    without = unsolved(effects)
    nothing = any(
        change is None and reason is None
        for effect in effects
        for changes in (effect.delta_percent, effect.delta_nox_percent)
        for change, reason in zip(changes, effect.reasons, strict=True)
    )
    lines = [_EFFECTS_NOTES, *([_NOTHING] if nothing else []), *([_UNSOLVED] if without else [])]
    return "\n".join([*lines, *without])


def _empty(title: str, heads: Sequence[str], align: str) -> Table:
    """An empty table; align: l or r for each column."""
    table = Table(
        box=box.SIMPLE_HEAD, title=Text(title, style="table.title"), title_justify="left", pad_edge=False
    )  # fmt: skip
    for head, side in zip(heads, align, strict=True):
        table.add_column(head, justify="left" if side == "l" else "right", no_wrap=True)
    return table


def _ends(values: Sequence[float]) -> Sequence[float]:
    return values if len(values) == 1 else (values[0], values[-1])


def _signed(value: float | None, digits: int) -> str:
    if value is None:
        return "-"
    rounded = round(value, digits)
    return f"{rounded:+.{digits}f}" if rounded else "0"
