"""The waist: what a strategy sees of a car and a cycle, and what it gives back.

The powertrain is evaluated once for every step and every control; after that no strategy needs a car.
Axis order is (time, control). Power > 0 flows towards the wheels; battery power > 0 discharges.
"""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from hevopt.display.axes import Panel, drawn_over_time, speed_panel
from hevopt.display.facts import Shown
from hevopt.errors import DataError
from hevopt.problem.arrays import Array
from hevopt.problem.battery import Battery, energy_j, within_limits
from hevopt.problem.reject import Reject
from hevopt.problem.table import ControlTable
from hevopt.problem.thresholds import OPEN, Thresholds

# [E] of a machine between its shaft and the battery, where no map of its own is asked.
MACHINE_EFFICIENCY = 0.94

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.axes import Axes


@dataclass(frozen=True, slots=True, eq=False, repr=False, weakref_slot=True)
class Problem(Shown):
    """A control table, a battery and what is asked: least fuel + nox_weight x NOx, with enough charge left.

    soc_end_min: state of charge that must at least be left at the end
    start_mode: mode before the first step
    nox_weight: kg of fuel that a kg of NOx counts
    electricity_kgpj: kg of fuel that a joule from the battery's terminals counts; 0 but in a car without an engine
    thresholds: what the rules' thresholds are where they are not calibrated
    storing_kgpj: fuel that an engine of free speed takes to deliver a joule to the battery; None without one
    cost_kg: (time, control) what a step counts: fuel plus weighted NOx and electricity
    start_j, end_min_j, window_j: stored energy before the first step, least at the end, at the window's ends
    A control whose power the battery cannot deliver or take at every state of charge of its window is rejected.
    """

    table: ControlTable
    battery: Battery
    soc_start: float
    soc_end_min: float
    start_mode: int = 0
    nox_weight: float = 0.0
    electricity_kgpj: float = 0.0
    thresholds: Thresholds = OPEN
    storing_kgpj: float | None = None
    cost_kg: Array = field(init=False)
    start_j: float = field(init=False)
    end_min_j: float = field(init=False)
    window_j: tuple[float, float] = field(init=False)
    _origin: "Problem | None" = field(init=False, default=None)

    def __post_init__(self) -> None:
        low, high = self.battery.soc_min, self.battery.soc_max
        for name in ("soc_start", "soc_end_min"):
            if not low <= getattr(self, name) <= high:
                raise DataError(
                    f"{name} {getattr(self, name):g} lies outside the SOC window; allowed: "
                    f"{low:g} to {high:g}"
                )
        for key, soc in self.thresholds.socs.items():
            if not low <= soc <= high:
                raise DataError(
                    f"rules: {key} {soc:g} lies outside the SOC window; allowed: {low:g} to {high:g}, or leave it "
                    "out to have it calibrated"
                )
        if not (np.isfinite(self.nox_weight) and 0 <= self.nox_weight <= 1e6):
            raise DataError(f"nox_weight {self.nox_weight}; allowed: 0 to 1e6 kg fuel per kg NOx")
        if not 0 <= self.start_mode < self.table.modes:
            raise DataError(f"start_mode {self.start_mode}; allowed: 0 to {self.table.modes - 1}")
        beyond = ~within_limits(self.battery, self.table.battery_power_w)
        if (self.table.feasible & beyond).any():
            bits = np.where(beyond, np.uint16(Reject.BATTERY_LIMIT), np.uint16(0))
            table = replace(self.table, reject=self.table.reject | bits)
            object.__setattr__(self, "table", table)
        self._derive()

    def _derive(self) -> None:
        cost_kg = self.table.fuel_kg
        if self.nox_weight != 0:
            cost_kg = cost_kg + self.nox_weight * self.table.nox_kg
            cost_kg.flags.writeable = False
        if self.electricity_kgpj != 0:
            terminal_j = self.table.battery_power_w * self.table.step_s[:, None]
            cost_kg = cost_kg + self.electricity_kgpj * terminal_j
            cost_kg.flags.writeable = False
        socs = np.array(
            [self.soc_start, self.soc_end_min, self.battery.soc_min, self.battery.soc_max]
        )
        start, end, low, high = map(float, energy_j(self.battery, socs))
        for name, value in (
            ("cost_kg", cost_kg), ("start_j", start), ("end_min_j", end), ("window_j", (low, high)),
        ):  # fmt: skip
            object.__setattr__(self, name, value)

    def _facts(self) -> dict[str, object]:
        steps, controls = self.table.fuel_kg.shape
        return {
            "steps": steps,
            "controls": controls,
            "soc_start": self.soc_start,
            "soc_end_min": self.soc_end_min,
            "soc_window": (self.battery.soc_min, self.battery.soc_max),
            "nox_weight": self.nox_weight,
        }

    def with_nox_weight(self, nox_weight: float) -> "Problem":
        """The same problem with another objective, which shares its `origin`."""
        if nox_weight == self.nox_weight:
            return self
        weighted = replace(self, nox_weight=nox_weight)
        object.__setattr__(weighted, "_origin", self.origin)
        return weighted

    @property
    def origin(self) -> "Problem":
        """The problem from which this one was made by another weight on NOx, or itself.

        What no cost changes, such as from where an end charge can be reached, is worked out once for it.
        """
        return self if self._origin is None else self._origin


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class Plan(Shown):
    """A strategy's proposal. control: (time,) indices into the table; notes: what the solver can tell."""

    control: NDArray[np.int64]
    notes: Mapping[str, Any] = field(default_factory=dict)

    def _facts(self) -> dict[str, object]:
        return {"steps": len(self.control), "notes": self.notes}


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class Trajectory(Shown):
    """What a plan does on its problem, added up by simulate.

    energy_j, soc: (time + 1,), stored energy and state of charge at the steps' ends
    mode, fuel_kg, nox_kg, battery_power_w: (time,); fuel includes the cost of switching in its step
    switch_fuel_kg, switch_energy_j: (time,) what switching took, the energy from the battery before the step
    flows: name -> (time,) powers, speeds, torques and losses, worked out where they are first asked for
    residuals: component -> (time,) power balance, in W, 0 up to rounding; likewise
    """

    problem: Problem
    control: NDArray[np.int64]
    energy_j: Array
    soc: Array
    mode: NDArray[np.int64]
    fuel_kg: Array
    switch_fuel_kg: Array
    switch_energy_j: Array
    nox_kg: Array
    battery_power_w: Array
    cost_kg: float
    flows: Mapping[str, Array]
    residuals: Mapping[str, Array]

    def _facts(self) -> dict[str, object]:
        return {
            "steps": len(self.control),
            "fuel_kg": self.total_fuel_kg,
            "nox_kg": self.total_nox_kg,
            "cost_kg": self.cost_kg,
            "soc_start": float(self.soc[0]),
            "soc_end": float(self.soc[-1]),
        }

    @property
    def total_fuel_kg(self) -> float:
        """Fuel burnt, starts and shifts included."""
        return float(np.sum(self.fuel_kg))

    @property
    def total_nox_kg(self) -> float:
        """NOx emitted."""
        return float(np.sum(self.nox_kg))

    @property
    def end_j(self) -> float:
        """Stored energy left."""
        return float(self.energy_j[-1])

    def to_frame(self) -> "pd.DataFrame":
        """One line per step, units in the names; what is a state is told at the step's start and at its end.

        Step k goes from time_s to time_s + step_s; speed_mps is its mean, powers and torques hold over it, fuel
        and NOx are the step's own. mode: that of the step, which its control leads to. Signals, flows, residuals
        and missing torque are there where the problem's table has them.
        """
        import pandas as pd

        table = self.problem.table
        columns: dict[str, Any] = {"time_s": table.time_s, "step_s": table.step_s}
        if table.signals is not None:
            speed = table.signals.speed_mps
            columns |= {"distance_end_m": np.cumsum(speed * table.step_s), "speed_mps": speed}
            columns |= {"gear": table.signals.gear, "clutch_open": table.signals.clutch_open}
        columns |= {
            "control": self.control,
            "mode": self.mode,
            **table.labels_of(self.control),
            "soc_start": self.soc[:-1],
            "soc_end": self.soc[1:],
            "energy_start_j": self.energy_j[:-1],
            "energy_end_j": self.energy_j[1:],
        }
        for name in ("fuel_kg", "switch_fuel_kg", "switch_energy_j", "nox_kg", "battery_power_w"):
            columns[name] = getattr(self, name)
        columns |= self.flows
        if table.missing_torque_nm is not None:
            columns["missing_torque_nm"] = table.missing_torque_nm
        residuals = {f"residual_{n.replace(' ', '_')}_w": r for n, r in self.residuals.items()}
        return pd.DataFrame(columns | residuals)

    def plot(self, axes: "Iterable[Axes] | None" = None) -> "list[Axes]":
        """Speed, powers, charge with its window, and fuel burnt so far, above each other over time.

        Speed is left out where the problem's table has no signals, the engine's power where it has no flows.
        axes: of matplotlib, one for each; by default new ones. Raises DataError where there are not as many.
        """
        table, pack = self.problem.table, self.problem.battery
        power_w = {"battery": self.battery_power_w}
        if "engine_torque_nm" in self.flows:
            torque, speed = self.flows["engine_torque_nm"], self.flows["engine_speed_radps"]
            power_w = {"wheels": self.flows["wheel_power_w"], "engine": torque * speed, **power_w}
        panels = [
            Panel("power, kW", {name: power / 1e3 for name, power in power_w.items()}),
            Panel("SOC", {"SOC": self.soc}, (pack.soc_min, pack.soc_max)),
            Panel("fuel so far, g", {"fuel": np.append(0.0, np.cumsum(self.fuel_kg) * 1e3)}),
        ]
        if table.signals is not None:
            panels.insert(0, speed_panel(table.signals.speed_mps))
        edges_s = np.append(table.time_s, table.time_s[-1] + table.step_s[-1])
        return drawn_over_time(edges_s, panels, axes=axes)
