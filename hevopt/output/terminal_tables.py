"""Tables for the terminal, the page of strategies, control tables as .npz."""

from collections.abc import Mapping
from typing import Any

from rich import box
from rich.table import Table
from rich.text import Text

from hevopt.files.shown import printable
from hevopt.problem.problem import Plan
from hevopt.reproduction.published import published_beside
from hevopt.studies.comparison import Comparison
from hevopt.studies.rows import Row, end_asked_text, marked, no_reference_text

_CAUSAL_MARK = "†"


def comparison_table(comparison: Comparison) -> Table:
    """The rows as a table for the terminal."""
    table = Table(
        box=box.SIMPLE_HEAD,
        title=Text(f"cycle {comparison.cycle}", style="table.title"),
        title_justify="left",
        collapse_padding=True,
        pad_edge=False,
    )
    for name in ("car", "strategy"):
        table.add_column(name, no_wrap=True)
    for head in (
        "fuel\nl/100km", "vs ref\n%", "CO2\ng/km", "NOx\nmg/km", "vs ref\n%", "ΔSOC", "ΔE/fuel\n%",
        "corrected\nl/100km", "starts", "bound\nl/100km", "gap\n%",
    ):  # fmt: skip
        table.add_column(head, justify="right", no_wrap=True)
    table.add_column("proof", no_wrap=True)
    table.add_column("s", justify="right", no_wrap=True)
    table.add_column("status")
    previous = None
    for row in comparison.rows:
        if previous not in (None, row.architecture):
            table.add_section()
        previous = row.architecture
        # Text, because a name such as "[red]" would be markup in a string.
        table.add_row(*map(Text, _cells(row, comparison.causal)))
    return table


def _cells(row: Row, causal: frozenset[str]) -> list[str]:
    def number(value: float | None, form: str) -> str:
        return "-" if value is None else format(0.0 if abs(value) < 5e-7 else value, form)

    change = None
    if row.soc_end is not None and row.soc_start is not None:
        change = row.soc_end - row.soc_start
    return [
        row.architecture,
        row.strategy + (_CAUSAL_MARK if row.strategy in causal else ""),
        number(row.fuel_l_per_100km, ".3f"),
        number(row.delta_fuel_percent, "+.1f"),
        number(row.co2_g_per_km, ".1f"),
        number(row.nox_mg_per_km, ".0f"),
        number(row.delta_nox_percent, "+.1f"),
        number(change, "+.4f"),
        number(row.delta_energy_percent, "+.2f"),
        number(row.fuel_corrected_l_per_100km, ".3f"),
        "-" if row.engine_starts is None else str(row.engine_starts),
        number(row.bound_l_per_100km, ".3f"),
        number(row.gap_percent, ".3f"),
        "-" if row.certificate is None else str(row.certificate.proof),
        number(row.solve_s, ".2f"),
        str(row.status),
    ]


def comparison_notes(comparison: Comparison) -> str:
    """What the columns mean, below the table."""
    objective = "fuel"
    if comparison.nox_weight:
        objective = f"fuel + {comparison.nox_weight:g} x NOx (in kg), as fuel volume"
    return (
        f"vs ref: against {_reference(comparison)}. corrected: fuel less what the end charge is worth "
        "(multiplier of the dual).\n"
        f"{_end_notes(comparison)}"
        f"bound: no plan over the tabulated controls with that row's end charge has less {objective}; "
        "gap: how far the row is above it.\n"
        f"{_CAUSAL_MARK}: causal, decides without knowing the rest of the cycle.\n"
        "proof: one multiplier = one price on stored energy; costate prices, LP prices = one per step; "
        "lower-bound DP = a cost-to-go nowhere above the true one."
        f"{_nox_note(comparison)}"
        f"{_lost_note(comparison)}"
    )


def _reference(comparison: Comparison) -> str:
    """The row that the others are compared with, and what is to be known of it."""
    for row in comparison.rows:
        if f"{row.architecture} {row.strategy}" == comparison.reference:
            return f"{comparison.reference}{marked(row.status)}"
    return no_reference_text(comparison.rows)


def _end_notes(comparison: Comparison) -> str:
    """What is asked of the end charge, where that is not the start's."""
    if not comparison.end_asked:
        return ""
    return (
        f"end charge asked, other than the start's: {end_asked_text(comparison.end_asked)}. "
        "ΔE/fuel and corrected count only what is left beyond it;\n"
        "electricity drawn from the battery down to it (or stored up to it) is not counted as fuel, nor in "
        "vs ref.\n"
    )


def _lost_note(comparison: Comparison) -> str:
    lost = comparison.lost_proofs.items()
    return "".join(f"\nproof not found: {printable(f'{which}: {why}')}" for which, why in lost)


def _nox_note(comparison: Comparison) -> str:
    rows = comparison.rows
    unknown = [r for r in rows if r.nox_mg_per_km is None and r.fuel_l_per_100km is not None]
    if not unknown:
        return ""
    cars = ", ".join(dict.fromkeys(printable(row.architecture) for row in unknown))
    return f"\nNOx is unknown for {cars}, whose engine has no data on it."


def published_table(comparison: Comparison) -> Table | None:
    """Published figures beside ours; None on other cycles, without the reference or the cases."""
    statements = published_beside(comparison)
    if not statements:
        return None
    title = "published study (Millo, Rolando, Andreata 2011) beside ours, nothing tuned"
    table = Table(box=box.SIMPLE_HEAD, title=title, title_justify="left")
    for head in ("change", "published", "ours", "what differs"):
        table.add_column(head, justify="right" if head == "ours" else "left")
    for statement in statements:
        table.add_row(*statement)
    return table


def calibration_table(plan: Plan) -> Table | None:
    """The calibration curve of a rule-based strategy; None for the others."""
    members: list[Mapping[str, Any]] = plan.notes.get("calibration", [])
    if len(members) < 2:
        return None
    title = "calibration: * taken; passed over: the end charge is worth more than 1 % of the cost"
    table = Table(box=box.SIMPLE_HEAD, title=title, title_justify="left")
    capped = "nox_cap_kgps" in members[0]
    heads = ["electric below kW", *(["NOx cap mg/s"] if capped else []), "cost kg", "corrected kg",
             "NOx g", "end surplus kJ", "passed over", ""]  # fmt: skip
    for head in heads:
        table.add_column(head, justify="right")
    for n, member in enumerate(members):
        cap = [f"{member['nox_cap_kgps'] * 1e6:.2f}"] if capped else []
        table.add_row(
            f"{member['threshold_w'] / 1e3:.2f}", *cap,
            f"{member['cost_kg']:.5f}", f"{member['corrected_kg']:.5f}",
            f"{member['nox_kg'] * 1e3:.3f}", f"{member['surplus_j'] / 1e3:+.1f}",
            "" if member["eligible"] else "yes", "*" if n == plan.notes["chosen"] else "",
        )  # fmt: skip
    return table
