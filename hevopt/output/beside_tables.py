"""Tables for the terminal beside a comparison's: the published figures, and the calibration of a rule."""

from collections.abc import Mapping
from math import isfinite
from typing import Any

from rich import box
from rich.table import Table

from hevopt.output.tables import needed_width
from hevopt.problem.problem import Plan
from hevopt.reproduction.published import published_beside
from hevopt.studies.comparison import Comparison
from hevopt.units import KMH_PER_MPS

# Of text beside figures; wraps to no less.
_LEAST_PROSE = 24


def published_table(comparison: Comparison, width: int | None = None) -> Table | None:
    """Published figures beside ours; None on other cycles, without the reference or the cases.

    What differs goes on in the next line where the table would be wider than `width`.
    """
    statements = published_beside(comparison)
    if not statements:
        return None
    title = "published study (Millo, Rolando, Andreata 2011) beside ours, nothing tuned"
    table = Table(box=box.SIMPLE_HEAD, title=title, title_justify="left")
    for head in ("change", "published", "ours"):
        table.add_column(head, justify="right" if head == "ours" else "left", no_wrap=True)
    table.add_column("what differs")
    for statement in statements:
        table.add_row(*statement)
    over = 0 if width is None else needed_width(table) - width
    if over > 0:
        longest = max(len(statement.differs) for statement in statements)
        table.columns[-1].max_width = max(longest - over, _LEAST_PROSE)
    return table


def _or_any(limit: float, digits: int) -> str:
    return f"{limit:.{digits}f}" if isfinite(limit) else "any"


def thresholds_line(thresholds: Mapping[str, float]) -> str:
    """What a rule's calibration took, as the keys of a car's file."""
    own = ", ".join(f"{key} = {value:.4g}" for key, value in thresholds.items())
    return f"as keys of [rules] in the car's file: {own}"


def calibration_table(plan: Plan) -> Table | None:
    """The calibration curve of a rule-based strategy; None for the others."""
    members: list[Mapping[str, Any]] = plan.notes.get("calibration", [])
    if len(members) < 2:
        return None
    title = "calibration: * taken; passed over: the end charge is worth more than 1 % of the cost"
    table = Table(box=box.SIMPLE_HEAD, title=title, title_justify="left")
    capped = "nox_cap_kgps" in members[0]
    heads = ["electric below kW", "below km/h", "above SOC", *(["NOx cap mg/s"] if capped else []),
             "cost kg", "corrected kg", "NOx g", "end surplus kJ", "passed over", ""]  # fmt: skip
    for head in heads:
        table.add_column(head, justify="right")
    for n, member in enumerate(members):
        cap = [f"{member['nox_cap_kgps'] * 1e6:.2f}"] if capped else []
        table.add_row(
            _or_any(member["threshold_w"] / 1e3, 2), _or_any(member["threshold_mps"] * KMH_PER_MPS, 0),
            f"{member['threshold_soc']:.2f}", *cap,
            f"{member['cost_kg']:.5f}", f"{member['corrected_kg']:.5f}",
            f"{member['nox_kg'] * 1e3:.3f}", f"{member['surplus_j'] / 1e3:+.1f}",
            "" if member["eligible"] else "yes", "*" if n == plan.notes["chosen"] else "",
        )  # fmt: skip
    return table
