"""Architecture and component files: TOML, checked by pydantic, read into frozen types.

An architecture names its components; a name is looked for in `components/` beside the file, then among the
shipped ones, and a path is relative to the file. Any key of either can be changed on reading, by its path.
"""

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Literal, NamedTuple, TypeVar

from hevopt.architecture_file import ArchitectureFile, CouplingFile, CouplingKind
from hevopt.battery import Battery
from hevopt.battery_file import BatteryFile
from hevopt.car_file import CarFile
from hevopt.components import battery_of, engine_of, gearbox_of, machine_of, vehicle_of
from hevopt.datafile import Model, checked, read_contents
from hevopt.engine import Engine
from hevopt.engine_file import EngineFile
from hevopt.errors import DataError
from hevopt.files import find, is_path, printable, shipped_folder, shown
from hevopt.gearbox_file import GearboxFile
from hevopt.keypaths import merged, with_changes
from hevopt.machine import Machine
from hevopt.machine_file import MachineFile
from hevopt.transmission import Gearbox
from hevopt.units import TO_SI
from hevopt.vehicle import Vehicle

Built = TypeVar("Built")
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
    own, of_parts = sorted_changes(changes or {})
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

    battery, soc = part("battery", BatteryFile, lambda file: (battery_of(file), file.soc))
    gearbox = part("gearbox", GearboxFile, gearbox_of)
    if data.coupling.kind == "even_shaft" and len(gearbox.ratios) < 3:
        raise DataError(
            f"{path}, gearbox: {shown(data.gearbox)} has 1 gear; coupling kind 'even_shaft' needs 2 "
            "or more; choose another gearbox or kind"
        )
    car = Architecture(
        name=data.name,
        description=data.description,
        vehicle=part("car", CarFile, lambda file: vehicle_of(file, data.hybrid_mass_kg)),
        engine=part("engine", EngineFile, engine_of),
        gearbox=gearbox,
        machine=part("machine", MachineFile, machine_of),
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


def sorted_changes(
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

    def fits(stem: str) -> bool:
        """Whether a file's name, such as engine_x or my_engine, tells of no other kind of component."""
        return key in stem or not any(other in stem for other in COMPONENTS)

    try:
        found = find("architectures/components", name, ".toml", beside=folder, fits=fits)
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
