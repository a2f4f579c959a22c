"""The control table: what every control burns and draws at every step, and what it costs to switch."""

from collections.abc import Mapping
from dataclasses import dataclass, field, fields
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from hevopt.display.facts import Shown
from hevopt.errors import DataError
from hevopt.problem.arrays import Array, Flags, Indices
from hevopt.problem.cells import BETWEEN, Between, SplitCells, TableFigures, cells_between
from hevopt.problem.flows import Flows, GivenFlows
from hevopt.problem.frozen import frozen
from hevopt.problem.given import no_switching, one_per_step
from hevopt.problem.reject import REJECT_WORDS, Reject

if TYPE_CHECKING:
    import pandas as pd


_SWITCHING = ("switch_fuel_kg", "switch_allowed", "switch_energy_j")


class Control(NamedTuple):
    """Label of a control: engine turning or not, the machine's gear (0 where it has none), torque level, and
    the engine's gear where it is a choice (0 where the cycle gives it)."""

    engine_on: bool
    machine_gear: int
    level: str
    engine_gear: int = 0


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class Signals(Shown):
    """What a rule may look at, all (time,): the driver's view of the step."""

    speed_mps: Array
    wheel_power_w: Array
    gear: Indices
    clutch_open: Flags

    def __post_init__(self) -> None:
        _freeze(self, {"gear": np.int64, "clutch_open": np.bool_}, "signals: ")

    def __reduce__(self) -> tuple[Any, ...]:
        return type(self), tuple(getattr(self, part.name) for part in fields(self))


@dataclass(frozen=True, slots=True, eq=False, repr=False, weakref_slot=True)
class ControlTable(Shown):
    """Every control at every step. It copies what it is given, and nothing in it can be changed.

    time_s, step_s: (time,) start and length of the steps
    fuel_kg, nox_kg, battery_power_w: (time, control) per step; finite also where rejected
    reject: (time, control) bits of Reject, 0 = feasible
    mode: (control,) discrete state the control leads to
    switch_fuel_kg, switch_allowed, switch_energy_j: (mode, mode) [from, to], or one for each step, (time, mode,
    mode); the energy is taken from what the battery stores, before the step, > 0 where going there takes some
    flows: name -> (time, control) powers, speeds and torques for the energy balance; may be empty
    missing_torque_nm: (time,) wheel torque that no control could deliver and that was left undriven
    between: what is known between neighbours, usable controls of one step and mode next to each other by their
    power, "convex" where fuel and NOx are convex functions of battery power, "linear" where they are straight lines
    from neighbour to neighbour; a certificate then speaks of all that lies between, else of these controls alone
    """

    time_s: Array
    step_s: Array
    fuel_kg: Array
    nox_kg: Array
    battery_power_w: Array
    reject: NDArray[np.uint16]
    mode: Indices
    switch_fuel_kg: Array
    switch_allowed: Flags
    controls: tuple[Control, ...]
    signals: Signals | None = None
    flows: Mapping[str, Array] = field(default_factory=dict)
    missing_torque_nm: Array | None = None
    switch_energy_j: Array = field(default_factory=lambda: np.zeros((0, 0)))
    between: Between = ""

    @classmethod
    def from_arrays(
        cls,
        fuel_kg: Array,
        battery_power_w: Array,
        feasible: Flags | None = None,
        *,
        step_s: float | Array = 1.0,
        nox_kg: Array | None = None,
        mode: Indices | None = None,
        switch_fuel_kg: Array | None = None,
        switch_allowed: Flags | None = None,
        switch_energy_j: Array | None = None,
        between: Between = "",
    ) -> "ControlTable":
        """A table from (time, control) arrays alone: any cost in kg, battery power, and what can be used.

        The power is that at the terminals: losses between them and the wheels are in it, those of the battery not.
        Where not feasible, fuel and power may be anything, NaN and infinity included. Without `mode` there is one;
        with it, `switch_fuel_kg` and `switch_energy_j` are (mode, mode) or (time, mode, mode), by default 0.
        Raises DataError where shapes do not agree, usable entries are not finite or contradict `between`.
        """
        fuel, power = frozen("fuel_kg", fuel_kg), frozen("battery_power_w", battery_power_w)
        if fuel.ndim != 2 or power.shape != fuel.shape or not fuel.size:
            raise DataError(
                "fuel_kg and battery_power_w must be one shape (time, control), with a step and a control at "
                f"least; found {fuel.shape} and {power.shape}"
            )
        usable = frozen("feasible", np.ones(fuel.shape) if feasible is None else feasible, np.bool_)
        nox = np.zeros_like(fuel) if nox_kg is None else frozen("nox_kg", nox_kg)
        if usable.shape != fuel.shape or nox.shape != fuel.shape:
            raise DataError(f"feasible and nox_kg must have the shape of fuel_kg, {fuel.shape}")
        steps = one_per_step(step_s, fuel.shape[:1])
        modes = frozen("mode", np.zeros(fuel.shape[1]) if mode is None else mode, np.int64)
        switch = no_switching(modes) if switch_fuel_kg is None else switch_fuel_kg
        switch = frozen("switch_fuel_kg", switch)
        allowed = np.ones(switch.shape[-2:], np.bool_) if switch_allowed is None else switch_allowed
        return cls(
            time_s=np.concatenate([[0.0], np.cumsum(steps)[:-1]]),
            step_s=steps,
            fuel_kg=np.where(usable, fuel, 0.0),
            nox_kg=np.where(usable, nox, 0.0),
            battery_power_w=np.where(usable, power, 0.0),
            reject=np.where(usable, 0, int(Reject.GIVEN)),
            mode=modes,
            switch_fuel_kg=switch,
            switch_allowed=allowed,
            controls=tuple(Control(True, 0, str(c)) for c in range(fuel.shape[1])),
            switch_energy_j=np.zeros((0, 0)) if switch_energy_j is None else switch_energy_j,
            between=between,
        )

    def cells(self, *, nox: bool = True) -> SplitCells | None:
        """What is known between neighbouring controls; DataError where what is declared contradicts them.

        nox: without it nothing need be said of NOx, whose lines may be 0"""
        figures = TableFigures(
            self.fuel_kg, self.nox_kg, self.battery_power_w, self.feasible, self.step_s
        )
        if not self.between:
            assert isinstance(self.flows, Flows)  # made so in __post_init__
            return self.flows.cells(figures, nox=nox)
        # What the battery alone refuses still tells how its neighbours go on.
        given = (self.reject & ~np.uint16(Reject.BATTERY_LIMIT)) == 0
        cells = cells_between(self.between, *figures[:3], given, self.mode)
        usable = figures.usable
        return cells.kept(usable[cells.step, cells.low] & usable[cells.step, cells.high])

    def __post_init__(self) -> None:
        types = {"reject": np.uint16, "mode": np.int64, "switch_allowed": np.bool_}
        if np.shape(self.switch_energy_j) == (0, 0):
            modes = np.shape(self.switch_fuel_kg)[-1:] * 2
            object.__setattr__(self, "switch_energy_j", np.zeros(modes))
        _freeze(self, types, "control table: ")
        if not isinstance(self.flows, Flows):
            object.__setattr__(self, "flows", GivenFlows(self.flows, "control table: "))
        object.__setattr__(self, "controls", tuple(self.controls))
        self._check_shapes()
        self._check_values()
        if self.between:
            self.cells()

    def __reduce__(self) -> tuple[Any, ...]:
        """Copies and pickles are made by the constructor, so that they cannot be changed either."""
        parts = {part.name: getattr(self, part.name) for part in fields(self)}
        if isinstance(self.flows, GivenFlows):
            parts["flows"] = dict(self.flows)
        return type(self), tuple(parts.values())

    def _check_shapes(self) -> None:
        if self.fuel_kg.ndim != 2 or not self.fuel_kg.size:
            raise DataError(
                f"control table: fuel_kg has shape {self.fuel_kg.shape}, expected (time, control), with a step "
                "and a control at least"
            )
        whole = steps, controls = self.fuel_kg.shape
        modes = self.modes if self.switch_fuel_kg.ndim > 1 else 0
        expected = {
            "time_s": (steps,),
            "step_s": (steps,),
            "nox_kg": whole,
            "battery_power_w": whole,
            "reject": whole,
            "mode": (controls,),
            **{
                name: (modes, modes) if getattr(self, name).ndim != 3 else (steps, modes, modes)
                for name in _SWITCHING
            },
            "missing_torque_nm": (steps,),
        }
        found = {name: getattr(self, name) for name in expected}
        if isinstance(self.flows, GivenFlows):
            found |= {f"flows {name}": values for name, values in self.flows.items()}
        for part in fields(Signals) if self.signals is not None else ():
            name = f"signals.{part.name}"
            found[name], expected[name] = getattr(self.signals, part.name), (steps,)
        for name, values in found.items():
            if values is not None and values.shape != expected.get(name, whole):
                raise DataError(
                    f"control table: {name} has shape {values.shape}, expected {expected.get(name, whole)}"
                    " (time, control), (mode, mode) or (time, mode, mode)"
                )
        if len(self.controls) != controls:
            raise DataError(f"control table: {len(self.controls)} labels for {controls} controls")

    def _check_values(self) -> None:
        for name in (
            "step_s", "time_s", "fuel_kg", "nox_kg", "battery_power_w", "switch_fuel_kg", "switch_energy_j"
        ):  # fmt: skip
            if not np.isfinite(getattr(self, name)).all():
                raise DataError(
                    f"control table: {name} holds NaN or infinite values; give any finite value "
                    "and mark the entry in reject or switch_allowed"
                )
        if self.between not in BETWEEN:
            raise DataError(
                f"control table: between is {self.between!r}; allowed: 'convex', 'linear', or '' for nothing known"
            )
        if (self.step_s <= 0).any():
            raise DataError("control table: every step_s must be > 0")
        if self.mode.min() < 0 or self.mode.max() >= self.modes:
            raise DataError(
                f"control table: mode runs from {self.mode.min()} to {self.mode.max()}; allowed: 0 "
                f"to {self.modes - 1}, the size of switch_fuel_kg"
            )
        if (self.switch_fuel_kg < 0).any():
            raise DataError("control table: switch_fuel_kg must be >= 0")

    @property
    def modes(self) -> int:
        """Number of modes."""
        return int(self.switch_fuel_kg.shape[-1])

    @property
    def feasible(self) -> Flags:
        """(time, control) True where the control can be used."""
        usable: Flags = self.reject == 0
        return usable

    def _facts(self) -> dict[str, object]:
        steps, controls = self.fuel_kg.shape
        return {
            "steps": steps,
            "controls": controls,
            "modes": self.modes,
            "duration_s": float(np.sum(self.step_s)),
            "feasible": f"{np.mean(self.reject == 0):.0%}",
        }

    def labels_of(self, control: Indices) -> dict[str, list[Any]]:
        """Column name -> what the labels say of each of some controls; a gear of 0 is none, or the cycle's."""
        labels = [self.controls[c] for c in control]
        return {
            "engine_on": [bool(label.engine_on) for label in labels],
            "engine_gear_chosen": [label.engine_gear for label in labels],
            "machine_gear": [label.machine_gear for label in labels],
            "level": [label.level for label in labels],
        }

    def to_frame(self) -> "pd.DataFrame":
        """One line per step and control, units in the names; rejected: why it cannot be used, or nothing."""
        import pandas as pd

        steps, controls = self.fuel_kg.shape
        step, control = np.divmod(np.arange(steps * controls), controls)
        bits, which = np.unique(self.reject, return_inverse=True)
        words = [", ".join(w for bit, w in REJECT_WORDS.items() if bit & found) for found in bits]
        return pd.DataFrame(
            {
                "step": step,
                "time_s": self.time_s[step],
                "step_s": self.step_s[step],
                "control": control,
                **self.labels_of(control),
                "mode": self.mode[control],
                "fuel_kg": self.fuel_kg.ravel(),
                "nox_kg": self.nox_kg.ravel(),
                "battery_power_w": self.battery_power_w.ravel(),
                "feasible": self.feasible.ravel(),
                "rejected": np.array(words, dtype=object)[which.ravel()],
            }
        )


def _freeze(parts: Signals | ControlTable, types: Mapping[str, type], place: str) -> None:
    """Put arrays that cannot be changed in the place of those given: of float64 but for the types named."""
    for part in fields(parts):
        if (
            part.name in ("controls", "signals", "flows", "between")
            or getattr(parts, part.name) is None
        ):
            continue
        values = frozen(
            place + part.name, getattr(parts, part.name), types.get(part.name, np.float64)
        )
        object.__setattr__(parts, part.name, values)
