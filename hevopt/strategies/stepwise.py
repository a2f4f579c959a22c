"""A rule from outside: what it sees of the present step, and the stepper that asks it."""

from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from hevopt.errors import DataError, InfeasibleError
from hevopt.problem import battery as battery_model
from hevopt.problem.holding import turning_modes
from hevopt.problem.problem import Plan, Problem
from hevopt.problem.rows import rows_ahead
from hevopt.problem.switching import Number, at_step
from hevopt.strategies.stepper import driven

Array = NDArray[np.float64]


class Step(NamedTuple):
    """The present step, as a rule sees it; of what comes, nothing but a preview that was asked for.

    k: its number; time_s: when it begins; step_s: how long it is
    soc, energy_j: state of charge and stored energy; mode: what the last control left; turning: the engine, in it
    soc_min, soc_max: window of the state of charge; soc_end_min: the least asked at the end of the drive
    usable: (control,) whether it can be taken here: not rejected, its switch allowed, the charge kept in its window
    fuel_kg, nox_kg: (control,) in this step
    switch_fuel_kg, switch_energy_j: (control,) for the switch that leads there; the energy is taken before the step
    battery_power_w: (control,) at the terminals, > 0 discharges; engine_on: (control,)
    drain_j: (control,) what the stored energy falls by, the switch included; NaN beyond what the voltage delivers
    ahead: this step and those of the preview as a problem that starts here, its end charge free, or None
    speed_mps, wheel_power_w, gear: of the car; NaN, NaN and 0 where the table has no signals
    """

    k: int
    time_s: float
    step_s: float
    soc: float
    energy_j: float
    mode: int
    turning: bool
    soc_min: float
    soc_max: float
    soc_end_min: float
    usable: NDArray[np.bool_]
    fuel_kg: Array
    nox_kg: Array
    switch_fuel_kg: Array
    switch_energy_j: Array
    battery_power_w: Array
    drain_j: Array
    engine_on: NDArray[np.bool_]
    ahead: Problem | None
    speed_mps: float
    wheel_power_w: float
    gear: int


def stepwise(problem: Problem, decide: Callable[[Step], int], *, preview: int = 0) -> Plan:
    """The plan of a rule that is asked at every step for the index of a control.

    preview: steps after the present one that the rule is shown
    Raises InfeasibleError at the first step that leaves no usable control, DataError where the rule gives another.
    """
    return Plan(driven(problem, AskedRule(problem, decide, preview))[0])


class AskedRule:
    """A rule as a stepper: it is shown each step, copied, and what it chooses is checked.

    preview: steps after the present one that the rule is shown
    """

    def __init__(self, problem: Problem, rule: Callable[[Step], int], preview: int = 0) -> None:
        self.problem, self.rule, self.preview = problem, rule, preview
        self.steps = Steps(problem)

    def decide(self, k: int, energy_j: float, mode: int) -> int:
        """Index of the control that the rule takes at step k."""
        now = self.steps.at(k, energy_j, mode)
        if not now.usable.any():
            raise InfeasibleError(
                f"at {_place(now)} no control is left: each is rejected, needs a forbidden switch or takes the "
                f"charge out of its window (SOC {now.soc:.4f})"
            )
        if self.preview:
            end = min(k + 1 + self.preview, len(self.problem.table.time_s))
            now = now._replace(ahead=rows_ahead(self.problem, k, end, energy_j, mode))
        return _checked(now, self.rule(now))


class Steps:
    """The steps of a problem, as a rule sees them for whatever is stored."""

    def __init__(self, problem: Problem) -> None:
        self.problem = problem
        self._engine_on = np.array([control.engine_on for control in problem.table.controls])
        self._turning = turning_modes(problem)
        self._window_j = problem.battery.granted_window_j

    def at(self, k: int, energy_j: float, mode: int) -> Step:
        """Step k, before which so much is stored and the last control left a mode; without a preview."""
        table, pack = self.problem.table, self.problem.battery
        low_j, high_j = self._window_j
        switch_kg, switch_j, allowed = (
            at_step(part, k)[mode, table.mode]
            for part in (table.switch_fuel_kg, table.switch_energy_j, table.switch_allowed)
        )
        between_j = energy_j - switch_j
        _, voltage, discharge, charge = battery_model.states(pack, between_j)
        power_w = table.battery_power_w[k]
        chemical_w = battery_model.chemical_power_w(
            pack, power_w, voltage, np.where(power_w < 0, charge, discharge)
        )
        after_j = between_j - table.step_s[k] * chemical_w
        signals = table.signals
        return Step(
            k=k,
            time_s=float(table.time_s[k]),
            step_s=float(table.step_s[k]),
            soc=float(battery_model.soc(pack, energy_j)),
            energy_j=energy_j,
            mode=mode,
            turning=bool(self._turning[mode]),
            soc_min=pack.soc_min,
            soc_max=pack.soc_max,
            soc_end_min=self.problem.soc_end_min,
            # NaN, a power beyond what the voltage delivers, is outside.
            usable=(table.reject[k] == 0)
            & allowed
            & (between_j >= low_j)
            & (between_j <= high_j)
            & (after_j >= low_j)
            & (after_j <= high_j),
            fuel_kg=_copied(table.fuel_kg[k]),
            nox_kg=_copied(table.nox_kg[k]),
            switch_fuel_kg=_copied(switch_kg),
            switch_energy_j=_copied(switch_j),
            battery_power_w=_copied(power_w),
            drain_j=_copied(energy_j - after_j),
            engine_on=_copied(self._engine_on),
            ahead=None,
            speed_mps=np.nan if signals is None else float(signals.speed_mps[k]),
            wheel_power_w=np.nan if signals is None else float(signals.wheel_power_w[k]),
            gear=0 if signals is None else int(signals.gear[k]),
        )


def _copied(row: NDArray[Number]) -> NDArray[Number]:
    """A row of its own, behind which no other stands, and which nobody can change."""
    own = row.copy()
    own.flags.writeable = False
    return own


def _checked(now: Step, chosen: int) -> int:
    """The index of a usable control that a rule chose."""
    index = index_of(now, chosen)
    if not now.usable[index]:
        raise DataError(
            f"the rule chose control {index} at {_place(now)}, which cannot be used there; choose among "
            f"np.flatnonzero(now.usable), {int(now.usable.sum())} of {len(now.usable)}"
        )
    return index


def index_of(now: Step, chosen: Any) -> int:
    """What was chosen as the index of a control; DataError where it is none."""
    controls = len(now.usable)
    try:
        index = int(chosen)
        whole = index == chosen and not isinstance(chosen, bool | np.bool_)
    except (TypeError, ValueError, OverflowError):
        whole = False
    if not whole or not 0 <= index < controls:
        raise DataError(
            f"the rule chose {chosen!r} at {_place(now)}; needed: the index of a control, 0 to {controls - 1}"
        )
    return index


def _place(now: Step) -> str:
    return f"step {now.k} (t = {now.time_s:g} s)"
