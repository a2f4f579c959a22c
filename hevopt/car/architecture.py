"""Architecture and component files: TOML, checked by pydantic, read into frozen types.

An architecture names its components; a name is looked for in `components/` beside the file, then among the
shipped ones, and a path is relative to the file. Any key of either can be changed on reading, by its path.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any, Literal

from hevopt.car.converter import Converter
from hevopt.car.driveline import Driveline
from hevopt.car.engine import Engine
from hevopt.car.handling import Handling
from hevopt.car.machine import Machine
from hevopt.car.transmission import Gearbox
from hevopt.car.vehicle import Vehicle
from hevopt.display.facts import Shown
from hevopt.errors import DataError
from hevopt.problem.arrays import Array
from hevopt.problem.battery import Battery
from hevopt.problem.thresholds import Thresholds

_USUAL = Handling()
Function = Literal["start_stop", "e_boost", "regenerative_braking", "nox_cut", "power_management"]


@dataclass(frozen=True, slots=True)
class Weighed:
    """A component's size in its unit (l, kW, kWh), mass and price; None where its file gives no figure."""

    size: float
    unit: str
    mass_kg: float | None
    price: float | None


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class Architecture(Shown):
    """A complete car: every component, how they are joined and the functions it may use.

    engine: `no_engine` in a car that has none
    gearbox: with the shift speeds; None without one whose gear the cycle lists
    machines: in the order of the driveline's
    soc_end: least state of charge at the end of a cycle
    thresholds: of the rules, as far as the file gives them
    contents: keys and values as read, changes made, the components' tables in place of their names
    files: where they were read from, the architecture first
    weighed: key of engine, machines and battery -> what each weighs and costs
    added_kg: of the vehicle's mass, what sizes have that changes made others
    converter: between battery and bus; None where they are one
    handling: what shows only where it is driven forward
    """

    name: str
    description: str
    vehicle: Vehicle
    engine: Engine
    gearbox: Gearbox | None
    machines: tuple[Machine, ...]
    battery: Battery
    soc_start: float
    soc_end: float
    driveline: Driveline
    functions: frozenset[str]
    thresholds: Thresholds
    gear: Literal["cycle", "free"]
    contents: Mapping[str, Any]
    files: tuple[Path, ...]
    weighed: Mapping[str, Weighed] = field(default_factory=dict)
    added_kg: float = 0.0
    converter: Converter | None = None
    handling: Handling = _USUAL

    def _facts(self) -> dict[str, object]:
        return {
            "name": self.name,
            "driveline": self.driveline.kind,
            "mass_kg": self.vehicle.mass_kg,
            "engine": self.engine.name,
            "machines": tuple(machine.name for machine in self.machines),
            "soc_start": self.soc_start,
            "gear": self.gear,
            "source": self.source,
        }

    def terminal_w(self, bus_w: Array) -> Array:
        """Power at the battery's terminals for one at the electric bus, > 0 out of the battery."""
        return bus_w if self.converter is None else self.converter.terminal_w(bus_w)

    def of_mass(self, mass_kg: float) -> "Architecture":
        """The same car of another mass, its rolling resistance in proportion."""
        vehicle = self.vehicle
        r0, r1, r2, r3 = (mass_kg / vehicle.mass_kg * r for r in vehicle.rolling_n)
        return replace(self, vehicle=replace(vehicle, mass_kg=mass_kg, rolling_n=(r0, r1, r2, r3)))

    @property
    def shift_gap_s(self) -> float:
        """The gap of the gearbox's file; none where each half of the gears has a clutch of its own."""
        several = len(self.driveline.driver_clutches) > 1
        return 0.0 if self.gearbox is None or several else self.gearbox.shift_gap_s

    @property
    def electric(self) -> bool:
        """Whether nothing but electricity drives it; its engine is then `no_engine`."""
        return self.driveline.engine is None

    @property
    def marks(self) -> frozenset[str]:
        """What strategies may need or not suit: its functions; "electric" without an engine; "free_engine_speed"
        where the engine has a speed of its own; "series" where it then turns apart from the wheels."""
        line = self.driveline
        own = {
            "electric": self.electric,
            "free_engine_speed": line.free_engine_speed,
            "series": line.free_engine_speed and line.engine_apart,
        }
        return self.functions | {mark for mark, holds in own.items() if holds}

    @property
    def source(self) -> Path:
        """The architecture's own file."""
        return self.files[0]

    @property
    def price(self) -> float | None:
        """Price of engine, machines and battery together, of those with one; None where none has."""
        prices = [part.price for part in self.weighed.values() if part.price is not None]
        return sum(prices) if prices else None

    def with_free_gear(self) -> "Architecture":
        """The same car with the engine's gear as a control; DataError where its gearbox does not allow it."""
        if self.gearbox is None:
            raise DataError(
                f"{self.source}: gear 'free' needs a gearbox, and the architecture has none; leave it out"
            )
        if self.gearbox.shift_fuel_kg is None:
            raise DataError(
                f"{self.source}: gear 'free' needs the table [free_gear] with shift_fuel_g and "
                f"engine_speed_min_rpm in the file of gearbox {self.gearbox.name!r}"
            )
        return replace(self, gear="free", contents={**self.contents, "gear": "free"})
