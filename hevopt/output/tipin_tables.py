"""A study of tip-ins for the terminal and as JSON."""

from collections.abc import Sequence
from dataclasses import asdict
from typing import Any

from rich.table import Table
from rich.text import Text

from hevopt.mean_value.balances import balances
from hevopt.output.tables import number, titled_table
from hevopt.tipin.drive import TipIn
from hevopt.tipin.figures import DEFINITIONS, GAINED_S, TIMES_S
from hevopt.units import KMH_PER_MPS, RPM_PER_RADPS


def feel_table(found: Sequence[TipIn], title: str) -> Table:
    """Accelerations of the cases, and what the steady map makes of them."""
    table = _table(title)
    for kind in ("a\nm/s²", "map / a\n-"):
        for n, time in enumerate(TIMES_S):
            word, _, unit = kind.partition("\n")
            table.add_column(
                f"{word if n == 0 else ''}\n{unit if n == 0 else ''}\n{time:g} s", justify="right"
            )
    table.add_column("gained\nkm/h\n5 s", justify="right")
    table.add_column("map\nkm/h\n5 s", justify="right")
    for tip_in in found:
        of = tip_in.figures
        table.add_row(
            Text(tip_in.case.label),
            *(f"{value:.2f}" for value in of.accel_mps2),
            *(f"{value:.2f}" for value in of.ratio),
            f"{of.gained_mps * KMH_PER_MPS:.1f}",
            f"{of.map_gained_mps * KMH_PER_MPS:.1f}",
        )
    return table


def engine_table(found: Sequence[TipIn]) -> Table:
    """What the engine goes through in each case."""
    table = _table("")
    for head in (
        "90 % boost\ns", "90 % torque\ns", "settled\n%", "lambda\nleast", "smoke\ns", "surge\nmargin",
        "turbo\nkrpm", "p4\nbar", "T4\nK", "hole\nNm s", "hole\nkJ", "peak\nkW",
    ):  # fmt: skip
        table.add_column(head, justify="right")
    for tip_in in found:
        of = tip_in.figures
        table.add_row(
            Text(tip_in.case.label), number(of.boost_90_s, 2), number(of.torque_90_s, 2),
            f"{100 * of.settled_share:.0f}", f"{of.least_excess_air:.2f}",
            f"{of.smoke_limited_s:.2f}", f"{of.surge_margin:.2f}",
            f"{of.turbo_max_radps * RPM_PER_RADPS / 1e3:.0f}", f"{of.exhaust_max_pa / 1e5:.2f}",
            f"{of.exhaust_max_k:.0f}", f"{of.hole_nms:.0f}", f"{of.hole_j / 1e3:.1f}",
            f"{of.hole_peak_w / 1e3:.1f}",
        )  # fmt: skip
    return table


def assist_table(found: Sequence[TipIn]) -> Table:
    """What a machine did where one helped."""
    table = _table("")
    for head in (
        "filled\n%",
        "work\nkJ",
        "electric\nkJ",
        "stored\nkJ",
        "peak\nkW",
        "charge\n%",
        "limited by\n",
    ):
        table.add_column(head, justify="right")
    for tip_in in found:
        of = tip_in.assist
        if of is not None:
            table.add_row(
                Text(tip_in.case.label), f"{100 * of.filled:.0f}", f"{of.work_j / 1e3:.1f}",
                f"{of.electric_j / 1e3:.1f}", f"{of.chemical_j / 1e3:.1f}", f"{of.peak_w / 1e3:.1f}",
                f"{100 * (of.soc[-1] - of.soc[0]):+.2f}", of.limited_by,
            )  # fmt: skip
    return table


def start_text(tip_in: TipIn) -> str:
    """The constant speed before the tip-in."""
    of = tip_in.figures.start
    return (
        f"before: {of.engine_radps * RPM_PER_RADPS:.0f} rpm, "
        f"turbocharger {of.turbo_radps * RPM_PER_RADPS / 1e3:.1f} krpm, "
        f"boost {of.boost_pa / 1e5:.3f} bar, pedal {100 * of.pedal:.0f} %, "
        f"recirculated {100 * of.egr_share:.0f} % of the charge, burnt {100 * of.burnt_share:.0f} %, "
        f"vanes {100 * of.vanes:.0f} %, lambda {of.excess_air:.2f}"
    )


def notes(found: Sequence[TipIn]) -> str:
    """Definitions of the columns, and the balances of the first case."""
    lines = [f"{name}: {text}" for name, text in DEFINITIONS.items()]
    lines.append(
        "balances of the first case, residual over what went through: "
        + ", ".join(f"{b.name} {b.residual:.0e}" for b in balances(found[0].run))
    )
    return "\n".join(lines)


def as_dict(tip_in: TipIn) -> dict[str, Any]:
    """Everything but the traces, for JSON."""
    assist = tip_in.assist
    return {
        "case": asdict(tip_in.case),
        "figures": asdict(tip_in.figures),
        "times_s": list(TIMES_S),
        "gained_after_s": GAINED_S,
        "balances": {b.name: b.residual for b in balances(tip_in.run)},
        "assist": None if assist is None else {
            "machine": assist.machine, "work_j": assist.work_j, "electric_j": assist.electric_j,
            "chemical_j": assist.chemical_j, "peak_w": assist.peak_w, "filled": assist.filled,
            "limited_by": assist.limited_by,
        },
    }  # fmt: skip


def _table(title: str) -> Table:
    table = titled_table(title)
    table.add_column("case", no_wrap=True)
    return table
