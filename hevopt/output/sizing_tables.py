"""What a sizing found, for the terminal and as JSON."""

from collections.abc import Iterator
from pathlib import Path
from typing import Any

from rich.table import Table
from rich.text import Text

from hevopt.files.shown import printable, shown
from hevopt.output.tables import titled_table
from hevopt.sizing.candidates import Candidate
from hevopt.sizing.size import Sizing

_FRONT_MAX = 30


def tables(found: Sizing) -> Iterator[Table]:
    """The best design with what it reaches, or the front of two objectives."""
    if len(found.study.objectives) > 1:
        yield _front_table(found)
    if found.best is not None:
        yield _design_table(found, found.best)
        if found.best.required:
            yield _required_table(found.best)


def notes(found: Sizing) -> str:
    """How the designs ended, and what is proven of them."""
    counts = ", ".join(f"{count} {fate}" for fate, count in found.counts.items() if count)
    lines = [f"{len(found.found)} designs: {counts}"]
    objective, best = found.study.objectives[0], found.best
    if best is not None and best.values is not None and found.least is not None:
        gap = best.values[0] / found.least - 1
        of = "no design of this lattice" if found.lattice else "no design that was tried"
        lines.append(
            f"{of} is below {found.least:.5g} ({objective.name}), certified; the best is {100 * gap:.3f} % above"
        )
    lines += _proof_lines(found)
    lines.append(f"results in {found.store}")
    return "\n".join(lines)


def _proof_lines(found: Sizing) -> list[str]:
    """What is proven of the sizes between those tried."""
    best, least = found.best, found.proven
    if best is None or best.values is None or least is None:
        return [] if found.lattice else [f"sizes between those tried: {found.unproven}"]
    ranges = found.proofs[0].ranges
    held = [
        f"{printable(key)} = {shown(value)}"
        for key, value in best.design.values.items()
        if key not in ranges
    ]
    listed = ", ".join(
        f"{printable(key)} {low:g} to {high:g}" for key, (low, high) in ranges.items()
    )
    lines = [
        f"no car of {listed}{' with ' + ', '.join(held) if held else ''}{_within(found)} is below {least:.5g} "
        f"({found.study.objectives[0].name}), whatever its strategy and requirements{_apart(found)}; the best is "
        f"{100 * (best.values[0] / least - 1):.2f} % above"
    ]
    for proof in found.proofs:
        lines.append(
            f"  {printable(proof.cycle)}: without requirements {proof.best_l_per_100km:.4f} is reached, "
            f"{100 * proof.gap:.2f} % above the bound, {proof.boxes} boxes in {proof.seconds:.1f} s"
        )
    return lines


def _within(found: Sizing) -> str:
    within = found.proofs[0].within
    return f" that meets {' and '.join(map(printable, within))}" if within else ""


def _apart(found: Sizing) -> str:
    apart = found.proofs[0].apart
    return f", and whether it meets {' and '.join(map(printable, apart))} or not" if apart else ""


def as_dict(found: Sizing) -> dict[str, Any]:
    """Everything, for JSON."""
    best = found.best
    return {
        "study": Path(found.study.sweep.source).name,
        "objectives": [objective.name for objective in found.study.objectives],
        "designs": {"tried": len(found.found), **found.counts},
        "lattice": found.lattice,
        "least_bound": found.least,
        "proven_over_ranges": found.proven,
        "not_proven": found.unproven,
        "best": None if best is None else _as_dict(found, best),
        "front": [_as_dict(found, one) for one in found.front],
    }


def _as_dict(found: Sizing, one: Candidate) -> dict[str, Any]:
    return {
        "parameters": dict(one.design.values),
        "derived": {k: v for k, v in one.design.changes.items() if k in found.study.sweep.derived},
        "values": one.values,
        "bounds": one.bounds,
        "fuel_l_per_100km": dict(zip(_cycles(found), one.fuel_l_per_100km, strict=True)),
        "bound_l_per_100km": dict(zip(_cycles(found), one.bound_l_per_100km, strict=True)),
        "mass_kg": None if one.car is None else one.car.vehicle.mass_kg,
        "price": None if one.car is None else one.car.price,
        "required": [
            {"figure": r.name, "reached": r.reached, "limit": r.limit} for r in one.required
        ],
    }


def _design_table(found: Sizing, best: Candidate) -> Table:
    table = titled_table(f"best design: least {found.study.objectives[0].name}")
    table.add_column("")
    table.add_column("value", justify="right")
    table.add_column("proven at least", justify="right")
    for key, value in best.design.changes.items():
        table.add_row(Text(printable(key)), shown(value), "")
    if best.car is not None:
        for key, part in best.car.weighed.items():
            mass = "" if part.mass_kg is None else f", {part.mass_kg:.1f} kg"
            table.add_row(Text(printable(key)), f"{part.size:.3g} {part.unit}{mass}", "")
        table.add_row("car, kg", f"{best.car.vehicle.mass_kg:.1f}", "")
        if best.car.price is not None:
            table.add_row("price of these parts", f"{best.car.price:.0f}", "")
    bounds = best.bound_l_per_100km or (None,) * len(best.fuel_l_per_100km)
    for cycle, fuel, bound in zip(_cycles(found), best.fuel_l_per_100km, bounds, strict=True):
        proven = "" if bound is None else f"{bound:.4f}"
        table.add_row(Text(f"{cycle}, l/100 km"), f"{fuel:.4f}", proven)
    return table


def _required_table(best: Candidate) -> Table:
    table = titled_table("requirements")
    for head, side in (("", "left"), ("reached", "right"), ("limit", "right")):
        table.add_column(head, justify="right" if side == "right" else "left")
    for one in best.required:
        sign = "<=" if one.file.at_most is not None else ">="
        reached = "-" if one.reached is None else f"{one.reached:.4g}"
        table.add_row(Text(one.name), reached, f"{sign} {one.limit:g}")
    return table


def _front_table(found: Sizing) -> Table:
    table = titled_table("front: no design tried is as good in both")
    for objective in found.study.objectives:
        table.add_column(objective.name, justify="right")
    keys = list(found.study.sweep.parameters)
    for key in keys:
        table.add_column(printable(key), justify="right")
    for one in found.front[:_FRONT_MAX]:
        values = [f"{value:.5g}" for value in one.values or ()]
        table.add_row(*values, *(shown(one.design.values[key]) for key in keys))
    return table


def _cycles(found: Sizing) -> list[str]:
    return [printable(Path(name).stem) for name in found.study.sweep.cycles]
