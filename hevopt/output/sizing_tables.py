"""What a sizing found, for the terminal and as JSON."""

from collections.abc import Iterator
from pathlib import Path
from typing import Any

from rich.table import Table
from rich.text import Text

from hevopt.files.shown import printable, shown
from hevopt.output.tables import titled_table
from hevopt.sizing.candidates import Candidate
from hevopt.sizing.found import Sizing
from hevopt.sizing.proof.prove import RangeProof
from hevopt.sizing.statements import statements

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
    """How the designs ended, what is proven of them, and where the results are."""
    return "\n".join([*statements(found), f"results in {found.store}"])


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
        "lattice_around_the_best": _around_dict(found),
        "proofs": [_proof_dict(proof) for proof in found.proofs],
        "best": None if best is None else _as_dict(found, best),
        "front": [_as_dict(found, one) for one in found.front],
    }


def _around_dict(found: Sizing) -> dict[str, Any] | None:
    around = found.around
    if around is None:
        return None
    return {
        "values": {key: list(values) for key, values in around.values.items()},
        "held": dict(around.held),
        "designs": around.designs,
        "least_bound": around.least,
    }


def _proof_dict(proof: RangeProof) -> dict[str, Any]:
    return {
        "cycle": printable(proof.cycle),
        "ranges": {key: list(ends) for key, ends in proof.ranges.items()},
        "bound_l_per_100km": proof.bound_l_per_100km,
        "best": dict(proof.best),
        "best_l_per_100km": proof.best_l_per_100km,
        "gap": proof.gap,
        "closed": proof.closed,
        "boxes": proof.boxes,
        "constraints_held": list(proof.within),
        "constraints_left_out": list(proof.apart),
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
