"""A forward run for the terminal, as JSON and as a table of its steps."""

from typing import TYPE_CHECKING, Any

import numpy as np
from rich.table import Table
from rich.text import Text

from hevopt.files.shown import printable
from hevopt.forward import _motor_kernels as motor
from hevopt.forward.run import ForwardRun
from hevopt.output.tables import number, titled_table
from hevopt.studies.driven import DrivenPlan
from hevopt.units import KMH_PER_MPS, RPM_PER_RADPS

if TYPE_CHECKING:
    import pandas as pd

# Flow -> what it is in the audit: where energy comes from, and where it goes.
SOURCES = {"fuel_power_w": "fuel", "battery_chemical_w": "battery"}
SINKS = {
    "engine_loss_w": "engine",
    "stop_w": "engine's momentum at stops",
    "clutch_launch_w": "clutch, launches",
    "clutch_change_w": "clutch, changes",
    "clutch_start_w": "clutch, starts",
    "clutch_other_w": "clutch, else",
    "torque_converter_launch_w": "torque converter, launches",
    "torque_converter_other_w": "torque converter, else",
    "gearbox_loss_w": "gearbox",
    "gear_loss_w": "gear pairs",
    "machine_loss_w": "machine",
    "battery_loss_w": "battery's loss",
    "converter_loss_w": "converter",
    "brake_power_w": "brakes",
    "tyre_lag_w": "tyre lag",
    "tyre_slip_w": "tyre slip",
    "tyre_spring_w": "tyres bent",
    "road_w": "road",
    "auxiliary_power_w": "auxiliaries",
}
_TINY_J = 0.5
_BOUND_NOTE = (
    "bound: of the backward problem at the forward run's end charge, over the forward run's distance, so for "
    "that row alone; its car follows the trace to the point and makes up for each gap of a change within its "
    "step; who drives otherwise, within the tolerance, may burn a little less"
)


def twin_table(driven: DrivenPlan) -> Table:
    """The run, its backward twin and the bound of that; a car without an engine burns nothing, and has no bound."""
    run, back = driven.run, driven.backward
    fuel = {
        "fuel\nl/100 km": (f"{driven.fuel_l_per_100km:.4f}", number(back.fuel_l_per_100km, 4)),
        "corrected\nl/100 km": (
            number(driven.corrected_l_per_100km, 4), number(back.fuel_corrected_l_per_100km, 4),
        ),
    }  # fmt: skip
    battery = f"{driven.electricity_kwh_per_100km:.3f}", number(back.electricity_kwh_per_100km, 3)
    nox = {"NOx\nmg/km": (number(driven.nox_mg_per_km, 1), number(back.nox_mg_per_km, 1))}
    soc = {"SOC\nend": (f"{run.soc[-1]:.4f}", number(back.soc_end, 4))}
    starts = {"starts\n": (f"{run.starts}", f"{back.engine_starts}")}
    columns = {"battery\nkWh/100 km": battery} | soc
    if not run.car.electric:
        columns = fuel | {"battery\nkWh/100 km": battery} | nox | soc | starts
    title = f"{run.car.name}, {driven.strategy} on {run.cycle.name}"
    table = _table(printable(title), "", *columns, "status\n")
    for n, name in enumerate(("forward", "backward")):
        status = ", ".join(driven.marks) or "ok" if n == 0 else str(back.status)
        table.add_row(name, *(cells[n] for cells in columns.values()), Text(status))
    if driven.bound_l_per_100km is not None:
        bound = f"{driven.bound_l_per_100km:.4f}"
        table.add_row("bound", bound, "", "", "", f"{run.soc[-1]:.4f}", "", "")
    return table


def audit_table(driven: DrivenPlan) -> Table:
    """Where the energy came from and where it went."""
    table = _table("energy, kJ", "from\n", "\nkJ", "to\n", "\nkJ")
    found = audit(driven.run).items()
    given = [(name, value) for name, value in found if value > _TINY_J]
    taken = [(name, -value) for name, value in found if value < -_TINY_J]
    for n in range(max(len(given), len(taken))):
        cells: list[str] = []
        for side in (given, taken):
            name, value = side[n] if n < len(side) else ("", None)
            cells += [name, "" if value is None else f"{value / 1e3:.1f}"]
        table.add_row(*cells)
    return table


def audit(run: ForwardRun) -> dict[str, float]:
    """Name -> energy that came from there, J; negative where it went there. The sum is 0 up to rounding.

    A loss that is negative (tyre lag) gives.
    """
    flows = run.books.flows

    def joules(name: str) -> float:
        return float(np.nansum(flows[name])) * run.step_s

    found = {name: joules(flow) for flow, name in SOURCES.items()}
    found["starter's loss"] = joules("start_w") - joules("starter_electric_w")
    # What is braked at stops comes back out of the shafts as a loss.
    found |= {
        name: joules(flow) if flow == "stop_w" else -joules(flow)
        for flow, name in SINKS.items()
        if flow in flows
    }
    kinetic = joules("kinetic_w") + joules("engine_inertia_w") + joules("machine_inertia_w")
    found["kinetic energy left"] = -kinetic
    return found


def notes(driven: DrivenPlan) -> str:
    """Drive quality, where the trace was left, and what the difference is made of."""
    run, q = driven.run, driven.run.quality
    lines = [
        how_text(driven),
        f"drive quality (SAE J2951): RMSSE {q.speed_error_mps * KMH_PER_MPS:.3f} km/h, "
        f"ER {q.energy_percent:+.2f} %, DR {q.distance_percent:+.3f} %, EER {q.energy_economy_percent:+.2f} %, "
        f"ASCR {q.speed_change_percent:+.2f} %, IWR {q.inertial_work_percent:+.2f} %",
        *engine_text(run),
        trace_text(run),
        f"at full load {run.full.sum() * run.step_s:.1f} s; "
        f"distance {run.distance_m - run.cycle.distance_m:+.2f} m; "
        f"charge at the end {driven.charge_error:+.4f} against the backward run's",
        change_text(driven),
        *([] if run.car.electric else [_BOUND_NOTE]),
        "energy that does not add up, as a share of what passed the wheels: "
        + ", ".join(f"{name} {value:.0e}" for name, value in run.residual.items()),
    ]
    return "\n".join(lines)


def change_text(driven: DrivenPlan) -> str:
    """How far the run is from its backward twin, and by which kinds of steps."""
    said = f"forward against backward, {compared(driven)}"
    if driven.change_percent is None:
        return f"{said}: no share can be told, as the backward run took none"
    parts = ", ".join(f"{kind} {value:+.2f} %" for kind, value in driven.difference_percent.items())
    return f"{said}: {driven.change_percent:+.2f} %; by kind of step: {parts}"


def compared(driven: DrivenPlan) -> str:
    """What of a run stands against its backward twin's."""
    return "charge-corrected" if driven.burns else "energy from the battery"


def how_text(driven: DrivenPlan) -> str:
    """Whether the strategy decided on the way, and how often."""
    if driven.asked is None:
        return f"{driven.strategy}: its plan for the cycle was replayed"
    every, dwell = driven.asked
    return (
        f"{driven.strategy}: decided on the way, every {every:g} s, from what was stored and asked for then; "
        f"the engine stayed on, and off, for {dwell:g} s at least"
    )


def engine_text(run: ForwardRun) -> list[str]:
    """What the mean-value engine did otherwise than the map; nothing by the map."""
    if run.against_map_percent is None:
        return []
    flows = run.books.flows
    work = np.abs(flows["engine_torque_nm"] * flows["engine_speed_radps"]).sum()
    lacking = np.abs(flows["gas_lacking_nm"] * flows["engine_speed_radps"]).sum()
    turns, rpm = run.engine == motor.TURNING, flows["turbo_speed_radps"] * RPM_PER_RADPS / 1e3
    return [
        f"engine: mean-value model; fuel {run.against_map_percent:+.2f} % against the map's at the same torques "
        f"and speeds; least lambda {flows['excess_air'][turns].min():.2f}, "
        f"turbocharger up to {rpm.max():.0f} 1000/min; "
        f"torque that its air could not keep within a step: {100 * lacking / max(work, 1e-9):.2g} % of its work; "
        "NOx by the map"
    ]


def trace_text(run: ForwardRun) -> str:
    """Where and for how long the trace was left by more than its tolerance."""
    left = run.quality.violations
    if not left:
        return "trace: within ±2 km/h and ±1 s everywhere"
    longest = max(left, key=lambda one: one.duration_s)
    return (
        f"trace: left ±2 km/h and ±1 s {len(left)} time{'s' if len(left) > 1 else ''}, "
        f"{run.quality.outside_s:.1f} s; "
        f"longest {longest.duration_s:.1f} s from t = {longest.start_s:.1f} s, by up to "
        f"{longest.beyond_mps * KMH_PER_MPS:.1f} km/h outside"
    )


def as_dict(driven: DrivenPlan) -> dict[str, Any]:
    """Everything but the traces, for JSON."""
    run, q = driven.run, driven.run.quality
    return {
        "car": run.car.name,
        "strategy": driven.strategy,
        "cycle": run.cycle.name,
        "asked": None if driven.asked is None else driven.asked._asdict(),
        "step_s": run.step_s,
        "engine_model": "map" if run.against_map_percent is None else "mean_value",
        "fuel_against_map_percent": run.against_map_percent,
        "fuel_l_per_100km": driven.fuel_l_per_100km,
        "electricity_kwh_per_100km": driven.electricity_kwh_per_100km,
        "corrected_l_per_100km": driven.corrected_l_per_100km,
        "bound_l_per_100km": driven.bound_l_per_100km,
        "nox_mg_per_km": driven.nox_mg_per_km,
        "soc_end": float(run.soc[-1]),
        "charge_error": driven.charge_error,
        "engine_starts": run.starts,
        "distance_m": run.distance_m,
        "full_load_s": float(run.full.sum() * run.step_s),
        "marks": list(driven.marks),
        "change_percent": driven.change_percent,
        "difference_percent": dict(driven.difference_percent),
        "quality": {
            **{name: _finite(getattr(q, name)) for name in q.__slots__ if name != "violations"},
            "outside_s": q.outside_s,
            "violations": [
                {"start_s": v.start_s, "duration_s": v.duration_s, "beyond_mps": v.beyond_mps}
                for v in q.violations
            ],
        },
        "energy_j": audit(run),
        "residual": dict(run.residual),
        "handling": {
            part: getattr(run.handling, part)._asdict()
            for part in ("tyre", "clutch", "shifting", "driver")
        },
        "backward": driven.backward.as_dict(),
    }


def steps_frame(run: ForwardRun) -> "pd.DataFrame":
    """One line per step, units in the names: speeds at its end, powers and torques over it."""
    import pandas as pd

    words = {
        motor.REST: "rest",
        motor.STARTING: "start",
        motor.TURNING: "turns",
        motor.STOPPING: "stop",
    }
    return pd.DataFrame(
        {
            "time_s": run.time_s[1:],
            "wanted_mps": run.wanted_mps[1:],
            "speed_end_mps": run.speed_mps[1:],
            "gear": run.gear,
            "engine": [words[phase] for phase in run.engine.tolist()],
            "soc": run.soc[1:],
            **dict(run.books.flows),
        }
    )


def _table(title: str, *heads: str) -> Table:
    table = titled_table(title)
    for n, head in enumerate(heads):
        words = n == 0 or head.startswith(("status", "to"))
        table.add_column(head, justify="left" if words else "right", no_wrap=words)
    return table


def _finite(value: float) -> float | None:
    return value if np.isfinite(value) else None
