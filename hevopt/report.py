"""Tables for the terminal, the page of strategies, control tables as .npz."""

import io
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from rich import box
from rich.table import Table
from rich.text import Text

from hevopt.files import printable
from hevopt.problem import Plan, Problem
from hevopt.published import published_beside
from hevopt.rows import Row, end_asked_text, marked, no_reference_text
from hevopt.status import Mark
from hevopt.strategies import STRATEGIES
from hevopt.study import Comparison
from hevopt.writing import write_whole

_CAUSAL_MARK = "†"

TABLE_README = """hevopt control table. Arrays are (time, control) unless said otherwise.
fuel_kg, nox_kg      burnt and emitted in the step; finite also where not feasible
battery_power_w      at the terminals during the step, > 0 discharges
feasible, reject     True where the control can be used; reject: bits saying why not, 0 = feasible
mode                 (control,) discrete state the control leads to
switch_fuel_kg       (mode, mode) [from, to] fuel of going from one mode to another, start_mode before step 0
switch_allowed       (mode, mode) [from, to]
controls             (control,) labels: engine on or off, engine gear (0: the cycle's), machine gear, torque level
time_s, step_s       (time,) start and length of the steps
soc_start, soc_end_min, soc_min, soc_max    state of charge: start, least at the end, window
nox_weight           kg of fuel that a kg of NOx counts; objective = sum(fuel + switch_fuel + nox_weight nox)
battery_soc, battery_open_circuit_v, battery_discharge_ohm, battery_charge_ohm    (point,) curves of the pack,
                     linear between points; battery_capacity_as; battery_coulombic_efficiency
Step of the battery, with stored energy E as the state:
  dE/dSOC = battery_capacity_as * Uoc(SOC), E = 0 at battery_soc[0]; R of discharge where P > 0, else of charge
  I = 2 P / (Uoc + sqrt(Uoc^2 - 4 R P)) at the SOC before the step
  E_next = E - step_s * Uoc * I * (battery_coulombic_efficiency where I < 0, else 1)
"""


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
        table.add_row(*map(Text, _cells(row)))
    return table


def _cells(row: Row) -> list[str]:
    def number(value: float | None, form: str) -> str:
        return "-" if value is None else format(0.0 if abs(value) < 5e-7 else value, form)

    change = None if row.soc_end is None else row.soc_end - row.soc_start
    return [
        row.architecture,
        row.strategy + (_CAUSAL_MARK if STRATEGIES[row.strategy].causal else ""),
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


def strategies_page(comparisons: Sequence[Comparison], steps: Mapping[str, int]) -> str:
    """Markdown: what each strategy knows, what a step costs to run, what it loses against the bound.

    steps: cycle -> number of its steps
    """
    cycles = [comparison.cycle for comparison in comparisons]
    rows = {
        (row.architecture, row.strategy, comparison.cycle): row
        for comparison in comparisons
        for row in comparison.rows
    }
    cars = list(dict.fromkeys(car for car, _, _ in rows))
    names = [name for name in STRATEGIES if any(name == strategy for _, strategy, _ in rows)]
    lines = [
        "# Strategies",
        "",
        "Made by `hevopt strategies --out reports/strategies.md`. Gap: cost above the certified bound at the",
        "row's own end charge, per cent; * not charge-neutral within 1 % of the fuel's energy; ! steps driven",
        "short of the cycle. ms: median over cars and cycles, the control table built.",
        "",
        "| strategy | knows | causal | ms per step |",
        "|---|---|---|---|",
    ]
    for name in names:
        times = sorted(
            1e3 * row.solve_s / steps[cycle]
            for (_, strategy, cycle), row in rows.items()
            if strategy == name and row.solve_s is not None
        )
        middle = f"{times[len(times) // 2]:.3f}" if times else "-"
        causal = "yes" if STRATEGIES[name].causal else "no"
        lines.append(f"| `{name}` | {STRATEGIES[name].knows} | {causal} | {middle} |")
    for car in cars:
        lines += ["", f"## {car}, gap %", "", "| strategy | " + " | ".join(cycles) + " |"]
        lines.append("|---" * (len(cycles) + 1) + "|")
        for name in names:
            cells = [_gap_cell(rows.get((car, name, cycle))) for cycle in cycles]
            lines.append(f"| `{name}` | " + " | ".join(cells) + " |")
    return "\n".join([*lines, ""])


def _gap_cell(row: Row | None) -> str:
    if row is None or row.gap_percent is None:
        return "-" if row is None else "failed"
    star = "*" if row.status.charge is Mark.NOT_NEUTRAL else ""
    return f"{row.gap_percent:.3f}{star}{'!' if row.status.shortfall_steps else ''}"


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


def write_table(path: Path, problem: Problem) -> None:
    """The problem as .npz arrays, enough for another solver to repeat ours; documented in its README entry."""
    table, pack = problem.table, problem.battery
    labels = [
        f"engine {'on' if c.engine_on else 'off'}, engine gear {c.engine_gear}, "
        f"machine gear {c.machine_gear}, {c.level}"
        for c in table.controls
    ]
    contents = io.BytesIO()
    np.savez_compressed(
        contents,
        README=np.array(TABLE_README),
        time_s=table.time_s, step_s=table.step_s, fuel_kg=table.fuel_kg, nox_kg=table.nox_kg,
        battery_power_w=table.battery_power_w, feasible=table.feasible, reject=table.reject,
        mode=table.mode, switch_fuel_kg=table.switch_fuel_kg, switch_allowed=table.switch_allowed,
        controls=np.array(labels), start_mode=problem.start_mode, nox_weight=problem.nox_weight,
        soc_start=problem.soc_start, soc_end_min=problem.soc_end_min, soc_min=pack.soc_min,
        soc_max=pack.soc_max, battery_soc=pack.soc, battery_open_circuit_v=pack.open_circuit_v,
        battery_discharge_ohm=pack.discharge_ohm, battery_charge_ohm=pack.charge_ohm,
        battery_capacity_as=pack.capacity_as,
        battery_coulombic_efficiency=pack.coulombic_efficiency,
    )  # fmt: skip
    write_whole(path, contents.getvalue())
