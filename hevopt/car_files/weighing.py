"""What engine, machines and battery weigh and cost by their size, and what another size adds to a car.

An architecture's own mass, car and hybrid parts, holds for the sizes that its files give. Where changes ask for
others the car gains, or loses, the difference: so many kg per litre, kW or kWh. A change of `hybrid_mass_kg` itself
says what all parts weigh, and nothing is added to it.
"""

from collections.abc import Mapping
from typing import Any

from hevopt.car.architecture import Weighed
from hevopt.car_files.battery import BatteryFile
from hevopt.car_files.components import battery_of
from hevopt.car_files.engine import EngineFile
from hevopt.car_files.machine import MachineFile
from hevopt.files.toml import FileModel

_CM3_PER_LITRE, _W_PER_KW, _J_PER_KWH = 1e3, 1e3, 3.6e6
OWN_MASS = "hybrid_mass_kg"
WEIGHED = ("engine", "machine", "machine_2", "machine_3", "battery")


def weighed(file: FileModel) -> Weighed:
    """Size, mass and price of a component by its file."""
    if isinstance(file, EngineFile):
        factor = 1.0 if file.scale is None else file.scale.factor
        litres = factor * file.displacement_cm3 / _CM3_PER_LITRE
        return _weighed(litres, "l", file.mass_kgpl, file.price_pl)
    if isinstance(file, MachineFile):
        factor = 1.0 if file.scale is None else file.scale.factor
        return _weighed(
            factor * file.power_max_w / _W_PER_KW, "kW", file.mass_kgpkw, file.price_pkw
        )
    assert isinstance(file, BatteryFile)  # only components of WEIGHED are asked
    kwh = float(battery_of(file).point_energy_j[-1]) / _J_PER_KWH
    return _weighed(kwh, "kWh", file.mass_kgpkwh, file.price_pkwh)


def added_kg(before: Mapping[str, Weighed], after: Mapping[str, Weighed]) -> float:
    """Mass that the sizes after add to those before, of the components that have one in both."""
    added = 0.0
    for key, part in after.items():
        known = before.get(key)
        if known is not None and known.mass_kg is not None and part.mass_kg is not None:
            added += part.mass_kg - known.mass_kg
    return added


def resized(changes: Mapping[str, Any]) -> bool:
    """Whether changes may make sizes others, and leave it to them what the car weighs."""
    return OWN_MASS not in changes and any(key.partition(".")[0] in WEIGHED for key in changes)


def _weighed(size: float, unit: str, mass: float | None, price: float | None) -> Weighed:
    return Weighed(
        size, unit, None if mass is None else mass * size, None if price is None else price * size
    )
