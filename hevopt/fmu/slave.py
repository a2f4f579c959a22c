"""The unit as its host sees it: a slave of PythonFMU around a car under commands."""

from pathlib import Path
from typing import Any

from pythonfmu import Boolean, Fmi2Slave, Integer, Real
from pythonfmu.enums import Fmi2Causality, Fmi2Initial, Fmi2Status, Fmi2Variability

from hevopt.car_files.load import load_architecture
from hevopt.car_files.whole import ARCHITECTURE
from hevopt.errors import DataError, HevoptError
from hevopt.fmu.variables import Given, gear_names, inputs_of, outputs_of, parameters_of
from hevopt.forward.commanded import CommandedCar, CommandedSteps, Commands

CAR_FOLDER, STEP_FILE = "car", "step_s.txt"
_TYPES = {"real": Real, "integer": Integer, "boolean": Boolean}
# Share of the unit's own step within which a communication step is a whole number of them.
_WHOLE = 1e-6
_STEPS_MAX = 1_000_000
# Of Commands -> the input that it is.
_COMMANDS = {
    "force_n": "force_asked_n", "hold": "hold", "grade": "grade", "gear": "gear_asked",
    "engine_on": "engine_on", "clutch_open": "clutch_open", "lock_up_open": "lock_up_open",
    "engine_radps": "engine_speed_asked_radps", "engine_nm": "engine_torque_asked_nm",
    "clutch_closed": "clutch_closed",
}  # fmt: skip
_kept: list[dict[str, Any]] = []


def keep(names: dict[str, Any]) -> None:
    """Hold a unit's names once more.

    PythonFMU 0.7.0 runs its module for every instance, and then gives back a reference to its names that it never
    took: the next instance would find them freed.
    """
    _kept.append(names)


class CarSlave(Fmi2Slave):  # type: ignore[misc]
    """A car in steps of its own, of which every communication step is a whole number.

    What is wrong is told by the log and refused by the step, after which the car is as it was before: an exception
    would take the host's instance with it.
    """

    def __init__(self, **given: Any) -> None:
        super().__init__(**given)
        folder = Path(self.resources)
        self._car = load_architecture(folder / CAR_FOLDER / ARCHITECTURE)
        step_s = float((folder / STEP_FILE).read_text())
        self.modelName = f"hevopt_{''.join(c if c.isalnum() else '_' for c in self._car.name)}"
        self.description = f"{self._car.name}, driven: {self._car.description}"
        self._one = CommandedCar(self._car, step_s=step_s)
        self._moved: CommandedSteps | None = None
        self._fault: str | None = None
        self._gears = gear_names(self._one)
        parameters = parameters_of(self._car, step_s)
        inputs = inputs_of(self._one)
        self._values: dict[str, Any] = {one.name: one.start for one in (*parameters, *inputs)}
        for one in parameters:
            self._take(one, Fmi2Causality.parameter, Fmi2Variability.fixed)
        for one in inputs:
            continuous = one.kind == "real"
            self._take(
                one, Fmi2Causality.input,
                Fmi2Variability.continuous if continuous else Fmi2Variability.discrete,
            )  # fmt: skip
        for told in outputs_of(self._one):
            variable = _TYPES[told.kind](
                told.name, causality=Fmi2Causality.output, description=told.meaning,
                variability=None if told.kind == "real" else Fmi2Variability.discrete,
                initial=Fmi2Initial.calculated,
                getter=lambda told=told: told.value(self._one, self._moved),
            )  # fmt: skip
            self.register_variable(variable, nested=False)

    def _take(self, given: Given, causality: Fmi2Causality, variability: Fmi2Variability) -> None:
        variable = _TYPES[given.kind](
            given.name, start=given.start, causality=causality, variability=variability,
            description=given.meaning,
            getter=lambda: self._values[given.name],
            setter=lambda value: self._values.__setitem__(given.name, value),
        )  # fmt: skip
        self.register_variable(variable, nested=False)

    def exit_initialization_mode(self) -> None:
        """The car with the parameters that were set."""
        values = self._values
        try:
            self._one = CommandedCar(
                self._car,
                step_s=values["step_s"],
                soc_start=values["soc_start"],
                speed_mps=values["speed_start_mps"],
            )
        except HevoptError as error:
            self._fault = f"parameters: {error}"
            self.log(self._fault, Fmi2Status.error)

    def do_step(self, current_time: float, step_size: float) -> bool:
        """Whether the car was moved on; False with a message in the log where it could not be."""
        try:
            if self._fault is not None:
                raise DataError(self._fault)
            self._moved = self._one.advance(self._commands(), self._steps(step_size))
        except HevoptError as error:
            self.log(f"t = {current_time:g} s: {error}", Fmi2Status.error)
            return False
        return True

    def _steps(self, step_size: float) -> int:
        own = self._one.step_s
        if not 0 < step_size <= _STEPS_MAX * own:  # nor NaN
            raise DataError(
                f"communication step {step_size:g} s; allowed: above 0, to {_STEPS_MAX * own:g} s"
            )
        steps = round(step_size / own)
        if steps < 1 or abs(step_size - steps * own) > _WHOLE * own:
            raise DataError(
                f"communication step {step_size:.9g} s is no whole number of the unit's own step, {own:g} s; set "
                "the parameter step_s before the start, or choose another communication step"
            )
        return steps

    def _commands(self) -> Commands:
        values, one = self._values, self._one
        given: dict[str, Any] = {name: values[of] for name, of in _COMMANDS.items() if of in values}
        if "source_power_asked_w" in values:
            given["engine_nm"] = values["source_power_asked_w"] / one.car.engine.idle_radps
        return Commands(
            **given,
            gears=tuple((box, values[name]) for name, box in self._gears.items()),
            machines_nm=tuple((name, values[f"{name}_asked_nm"]) for name in one.asked_machines),
        )

    def _get_fmu_state(self) -> dict[str, Any]:
        return {"values": dict(self._values), "one": self._one, "standing": self._one.standing,
                "moved": self._moved, "fault": self._fault}  # fmt: skip

    def _set_fmu_state(self, state: dict[str, Any]) -> None:
        self._values = dict(state["values"])
        self._one, self._moved, self._fault = state["one"], state["moved"], state["fault"]
        self._one.standing = state["standing"]
