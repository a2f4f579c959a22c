"""Architecture and component files: TOML, checked by pydantic, read into frozen types.

An architecture names its components; a name is looked for in `components/` beside the file, then among the
shipped ones, and a path is relative to the file. Any key of either can be changed on reading, by its path.
"""

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, replace
from math import inf
from pathlib import Path
from typing import Any, Literal, NamedTuple, TypeVar

import numpy as np

from hevopt.architecture_files import (
    ArchitectureFile,
    BatteryFile,
    CarFile,
    CouplingFile,
    CouplingKind,
    EngineFile,
    GearboxFile,
    LinearVoltageFile,
    LossMapFile,
    MachineFile,
)
from hevopt.battery import Battery
from hevopt.datafile import Model, checked, read_contents
from hevopt.engine import Engine, EngineGrid, FuelCoefficients, NoxCoefficients
from hevopt.errors import DataError
from hevopt.files import find, is_path, printable, shipped_folder, shown
from hevopt.keypaths import merged, with_changes
from hevopt.machine import LossGrid, Machine
from hevopt.scaling import scaled_engine, scaled_machine
from hevopt.transmission import Gearbox
from hevopt.units import STANDARD_GRAVITY_MPS2, TO_SI
from hevopt.vehicle import Vehicle

Built = TypeVar("Built")
_MASS_MIN_KG = 50.0
COMPONENTS = ("car", "engine", "gearbox", "machine", "battery")


@dataclass(frozen=True, slots=True)
class Coupling:
    """How the machine joins the shafts; see couplings.py."""

    kind: CouplingKind
    second_clutch: bool
    machine_ratio: float
    machine_efficiency: float
    disconnects_above_speed_max: bool
    machine_shift_fuel_kg: float


@dataclass(frozen=True, slots=True, eq=False)
class Architecture:
    """A complete car: every component, the coupling and the functions it may use.

    soc_end: least state of charge at the end of a cycle
    contents: keys and values as read, changes made, the components' tables in place of their names
    files: where they were read from, the architecture first
    """

    name: str
    description: str
    vehicle: Vehicle
    engine: Engine
    gearbox: Gearbox
    machine: Machine
    battery: Battery
    soc_start: float
    soc_end: float
    coupling: Coupling
    functions: frozenset[str]
    gear: Literal["cycle", "free"]
    contents: Mapping[str, Any]
    files: tuple[Path, ...]

    @property
    def source(self) -> Path:
        """The architecture's own file."""
        return self.files[0]

    def with_free_gear(self) -> "Architecture":
        """The same car with the engine's gear as a control; DataError where its gearbox does not allow it."""
        if self.gearbox.shift_fuel_kg is None:
            raise DataError(
                f"{self.source}: gear 'free' needs the table [free_gear] with shift_fuel_g and "
                f"engine_speed_min_rpm in the file of gearbox {self.gearbox.name!r}"
            )
        return replace(self, gear="free", contents={**self.contents, "gear": "free"})


def load_architecture(name: str | Path, changes: Mapping[str, Any] | None = None) -> Architecture:
    """The architecture of a shipped name (`C2`) or a TOML file's path.

    changes: key path -> value in place of the file's, such as {"hybrid_mass_kg": 80, "machine.power_max_w": 2e4};
    a path that begins with a component goes into that component's file. Raises DataError as for the file itself.
    """
    path = find("architectures", name, ".toml")
    own, of_parts = _sorted_changes(changes or {})
    contents = with_changes(read_contents(path), own)
    data = checked(_place(str(path), own), contents, ArchitectureFile)
    contents, files = dict(contents), [path]

    def part(key: str, model: type[Model], build: Callable[[Model], Built]) -> Built:
        found = component_contents(path, key, getattr(data, key), of_parts[key])
        contents[key] = found.contents
        files.append(found.file)
        file = checked(found.place, found.contents, model)
        try:
            return build(file)
        except DataError as error:
            raise DataError(f"{found.place}: {error}") from None

    battery, soc = part("battery", BatteryFile, lambda file: (_battery(file), file.soc))
    gearbox = part("gearbox", GearboxFile, _gearbox)
    if data.coupling.kind == "even_shaft" and len(gearbox.ratios) < 3:
        raise DataError(
            f"{path}, gearbox: {shown(data.gearbox)} has 1 gear; coupling kind 'even_shaft' needs 2 "
            "or more; choose another gearbox or kind"
        )
    car = Architecture(
        name=data.name,
        description=data.description,
        vehicle=part("car", CarFile, lambda file: _vehicle(file, data.hybrid_mass_kg)),
        engine=part("engine", EngineFile, _engine),
        gearbox=gearbox,
        machine=part("machine", MachineFile, _machine),
        battery=battery,
        soc_start=soc.start,
        soc_end=soc.start if soc.end is None else soc.end,
        coupling=_coupling(data.coupling),
        functions=frozenset(data.functions),
        gear="cycle",
        contents=contents,
        files=tuple(files),
    )
    return car.with_free_gear() if data.gear == "free" else car


def _sorted_changes(
    changes: Mapping[str, Any],
) -> tuple[dict[str, Any], dict[str, dict[str, Any]]]:
    """Changes of the architecture's own keys, and component -> changes in its file."""
    own: dict[str, Any] = {}
    of_parts: dict[str, dict[str, Any]] = {key: {} for key in COMPONENTS}
    for key, value in changes.items():
        first, _, rest = key.partition(".")
        if first in of_parts and rest:
            of_parts[first][rest] = value
        else:
            own[key] = value
    return own, of_parts


class ComponentContents(NamedTuple):
    """A component as an architecture has it: its file, its keys and values, and how a message names the two."""

    file: Path
    contents: dict[str, Any]
    place: str


def component_contents(
    path: Path, key: str, component: str | dict[str, Any], changes: Mapping[str, Any]
) -> ComponentContents:
    """The file that an architecture's key names, and its contents with what replaces them."""
    name = component if isinstance(component, str) else component["file"]
    beside = path.parent if is_path(name, ".toml") else path.parent / "components"
    folder = beside if beside.is_dir() else shipped_folder("architectures") / "components"
    try:
        found = find("architectures/components", name, ".toml", beside=folder)
    except DataError as error:
        raise DataError(f"{path}, {key}: {error}") from None
    table, place = read_contents(found), str(found)
    own = {} if isinstance(component, str) else {k: v for k, v in component.items() if k != "file"}
    if own:
        table = merged(table, own)
        place = f"{_place(place, [f'{key}.{name}' for name in own])} in {path}"
    place = _place(place, [f"{key}.{name}" for name in changes])
    return ComponentContents(found, with_changes(table, changes, within=f"{key}."), place)


def _place(place: str, changes: Iterable[str]) -> str:
    """How a message names a file, and what was changed in it."""
    changed = ", ".join(map(printable, changes))
    return f"{place}, with {changed} changed" if changed else place


def _coupling(data: CouplingFile) -> Coupling:
    return Coupling(
        data.kind,
        bool(data.second_clutch),
        data.machine_ratio or 1.0,
        data.machine_efficiency or 1.0,
        data.disconnects_above_speed_max,
        data.machine_shift_fuel_g * TO_SI["_g"][1],
    )


def _vehicle(car: CarFile, hybrid_mass_kg: float) -> Vehicle:
    load, mass_kg = car.road_load, car.mass_kg + hybrid_mass_kg
    if mass_kg < _MASS_MIN_KG:
        raise DataError(
            f"mass_kg {car.mass_kg:g} and the architecture's hybrid_mass_kg {hybrid_mass_kg:g} add up "
            f"to {mass_kg:g} kg; allowed: {_MASS_MIN_KG:g} kg or more; raise one of them"
        )
    if load.coastdown_c0_n is not None:
        rolling = (0.0, 0.0, 0.0, 0.0)
        air = (load.coastdown_c0_n, load.coastdown_c1_nspm, load.coastdown_c2_ns2pm2, 0.0)
    else:
        weight_n = mass_kg * STANDARD_GRAVITY_MPS2
        polynomial = (
            load.rolling_c0,
            load.rolling_c1_spm,
            load.rolling_c2_s2pm2,
            load.rolling_c3_s3pm3,
        )
        rolling = tuple(weight_n * c for c in polynomial)
        air = (0.0, 0.0, load.air_density_kgpm3 / 2 * load.drag_area_m2, 0.0)
    return Vehicle(
        car.name,
        mass_kg,
        car.tyre_radius_m,
        car.wheel_inertia_kgm2,
        car.auxiliary_power_w,
        rolling,
        air,
    )


def _engine(data: EngineFile) -> Engine:
    rpm, gram = TO_SI["_rpm"][1], TO_SI["_g"][1]
    if data.fuel_map is not None:
        grid = data.fuel_map
        nox = grid.nox_gps or np.zeros((len(grid.speed_rpm), len(grid.torque_nm)))
        fuel = EngineGrid(
            np.array(grid.speed_rpm) * rpm,
            np.array(grid.torque_nm),
            np.array(grid.fuel_gps) * gram,
            np.array(nox) * gram,
            np.array(grid.motoring_torque_nm),
        )
    else:
        fuel = FuelCoefficients(**data.fuel_coefficients.model_dump())
    nox = data.nox_coefficients
    engine = Engine(
        name=data.name,
        displacement_m3=data.displacement_cm3 * TO_SI["_cm3"][1],
        stroke_m=data.stroke_mm * TO_SI["_mm"][1],
        idle_radps=data.idle_rpm * rpm,
        inertia_kgm2=data.inertia_kgm2,
        start_fuel_kg=data.start_fuel_g * gram,
        heating_value_jpkg=data.fuel.heating_value_mjpkg * TO_SI["_mjpkg"][1],
        fuel_density_kgpm3=data.fuel.density_kgpl * TO_SI["_kgpl"][1],
        co2_kgpkg=data.fuel.co2_kgpkg,
        full_load_speed_radps=np.array(data.full_load.speed_rpm) * rpm,
        full_load_torque_nm=np.array(data.full_load.torque_nm),
        fuel=fuel,
        nox=None if nox is None else NoxCoefficients(**nox.model_dump()),
    )
    return engine if data.scale is None else scaled_engine(engine, data.scale.factor)


def _gearbox(data: GearboxFile) -> Gearbox:
    gears, kmh, free = len(data.ratios), TO_SI["_kmh"][1], data.free_gear
    efficiency = data.efficiency if isinstance(data.efficiency, list) else [data.efficiency] * gears
    return Gearbox(
        data.name,
        np.array([1.0, *data.ratios]) * data.final_drive_ratio,
        np.array([1.0, *efficiency]),
        np.array(data.shift_speeds.up_kmh) * kmh,
        np.array(data.shift_speeds.down_kmh) * kmh,
        data.shift_speeds.engage_before_launch_s,
        None if free is None else free.shift_fuel_g * TO_SI["_g"][1],
        0.0 if free is None else free.engine_speed_min_rpm * TO_SI["_rpm"][1],
    )


def _machine(data: MachineFile) -> Machine:
    loss = (data.loss_c0_w, data.loss_c1_ws, data.loss_c2_ws2, data.loss_c3_wpnm2)
    if data.loss_map is not None:
        loss = _loss_grid(data.loss_map)
    machine = Machine(
        data.name,
        data.power_max_w,
        data.torque_max_nm or inf,
        (data.speed_max_rpm or inf) * TO_SI["_rpm"][1],
        data.inertia_kgm2,
        None if data.kind == "efficiency" else loss,
        data.efficiency,
    )
    return machine if data.scale is None else scaled_machine(machine, data.scale.factor)


def _loss_grid(data: LossMapFile) -> LossGrid:
    torque, loss = np.array(data.torque_nm), np.array(data.loss_w)
    if data.symmetric:
        above = torque > 0
        torque = np.concatenate([-torque[above][::-1], torque])
        loss = np.hstack([loss[:, above][:, ::-1], loss])
    return LossGrid(np.array(data.speed_rpm) * TO_SI["_rpm"][1], torque, loss)


def _battery(data: BatteryFile) -> Battery:
    cells = data.cells_in_series
    points = np.array(data.curve_soc or [0.0, 1.0])
    voltage = data.open_circuit_v
    if isinstance(voltage, LinearVoltageFile):
        voltage = voltage.intercept + voltage.slope * points
    discharge, charge = (np.broadcast_to(r, points.shape) * cells for r in data.resistances())
    power_max_w = (data.power_max_w or inf) * cells
    current_max_a = data.current_max_a or inf
    return Battery(
        points, np.array(voltage) * cells, discharge, charge,
        data.capacity_ah * TO_SI["_ah"][1], data.coulombic_efficiency,
        data.soc.min, data.soc.max,
        power_max_w, power_max_w, current_max_a, current_max_a,
    )  # fmt: skip
