"""The real cars in both tools, on the cycles that they were measured on.

Fuel is worked out on one of them, warm and steady, where control decides least and the engine's law most.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

from hevopt.car_files.load import load_architecture
from hevopt.display.facts import Shown
from hevopt.driving.cycle import load_cycle
from hevopt.errors import SolverError
from hevopt.reproduction.cross_tool.fuel import FuelHeld, hold_fuel, planned
from hevopt.reproduction.cross_tool.tool import tool
from hevopt.reproduction.cross_tool.wheels import WheelsHeld, hold_wheels
from hevopt.reproduction.validation.laboratory import Laboratory, laboratories

FUEL_CYCLE = "hwfet"


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class CrossHeld(Shown):
    """A car on a cycle in both tools. fuel: None where not asked for or FASTSim gives up; why_not says why"""

    car: str
    cycle: str
    measured_l_per_100km: float
    wheels: WheelsHeld
    fuel: FuelHeld | None
    why_not: str

    def _facts(self) -> dict[str, object]:
        return {"car": self.car, "cycle": self.cycle, "off_w": self.wheels.off_w}


def hold_across(
    cars: Sequence[str] | None = None,
    cycles: Sequence[str] | None = None,
    progress: Callable[[str, int, int], None] = lambda text, done, total: None,
) -> list[CrossHeld]:
    """Every car and cycle with a test, or those of some; DataError for one without, or where FASTSim is missing.

    Fuel is of the cycles that are named, or else of `FUEL_CYCLE`.
    """
    tool()
    found, held = laboratories(cars, cycles), []
    for n, laboratory in enumerate(found):
        progress(f"{laboratory.car}, {laboratory.cycle}", n, len(found))
        held.append(cross(laboratory, fuel=cycles is not None or laboratory.cycle == FUEL_CYCLE))
    return held


def cross(laboratory: Laboratory, *, fuel: bool) -> CrossHeld:
    """A car and cycle in both tools, with or without its fuel."""
    car, cycle = load_architecture(laboratory.car), load_cycle(laboratory.cycle)
    wheels, found, why_not = hold_wheels(car, cycle), None, ""
    if fuel:
        case = planned(car, cycle)
        try:
            found = hold_fuel(case)
        except SolverError as error:
            why_not = str(error).splitlines()[-1].strip("] ")
    return CrossHeld(car.name, cycle.name, laboratory.fuel_l_per_100km, wheels, found, why_not)
