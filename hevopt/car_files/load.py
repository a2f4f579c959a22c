"""An architecture from its file and those of its components, with changes of any key made on reading."""

from collections.abc import Callable, Iterable, Mapping
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any, NamedTuple, TypeVar

from hevopt.car.architecture import Architecture, Weighed
from hevopt.car.driveline import Driveline
from hevopt.car.engine import no_engine
from hevopt.car.machine import Machine
from hevopt.car.templates import TEMPLATES, WITHOUT_GEARBOX, Options
from hevopt.car.transmission import Gearbox
from hevopt.car_files.architecture import ArchitectureFile, RulesFile
from hevopt.car_files.battery import BatteryFile
from hevopt.car_files.car import CarFile
from hevopt.car_files.components import (
    battery_of,
    converter_of,
    engine_of,
    gearbox_of,
    machine_of,
    vehicle_of,
)
from hevopt.car_files.driveline import CouplingFile
from hevopt.car_files.engine import EngineFile
from hevopt.car_files.gearbox import GearboxFile
from hevopt.car_files.handling import handling_of
from hevopt.car_files.kinds import COMPONENTS, MACHINES, kind_of
from hevopt.car_files.machine import MachineFile
from hevopt.car_files.parts import check_converter, driveline_of
from hevopt.car_files.source import SourceFile, source_of
from hevopt.car_files.weighing import WEIGHED, added_kg, resized, weighed
from hevopt.errors import DataError
from hevopt.files.keypaths import merged, with_changes
from hevopt.files.lookup import find, is_path, shipped_folder
from hevopt.files.shown import printable, shown
from hevopt.files.toml import FileModel, Model, checked, read_contents
from hevopt.problem.thresholds import OPEN, Thresholds
from hevopt.units import TO_SI

Built = TypeVar("Built")
Given = TypeVar("Given")


def load_architecture(name: str | Path, changes: Mapping[str, Any] | None = None) -> Architecture:
    """The architecture of a shipped name (`C2`) or a TOML file's path.

    changes: key path -> value in place of the file's, such as {"hybrid_mass_kg": 80, "machine.power_max_w": 2e4};
    a path that begins with a component goes into that component's file. Raises DataError as for the file itself.
    """
    path = find("architectures", name, ".toml")
    own, of_parts = sorted_changes(changes or {})
    contents = _changed(read_contents(path), own)
    data = checked(_place(str(path), own), contents, ArchitectureFile)
    contents, files = dict(contents), [path]
    files_of, places = dict[str, FileModel](), dict[str, str]()

    def part(key: str, model: type[Model], build: Callable[[Model], Built]) -> Built | None:
        if getattr(data, key) is None:
            if of_parts[key]:
                raise DataError(_not_there(path, key, of_parts[key]))
            return None
        found = component_contents(path, key, getattr(data, key), of_parts[key])
        contents[key], places[key] = found.contents, found.place
        files.append(found.file)
        files_of[key] = file = checked(found.place, found.contents, model)
        return _built(found.place, build, file)

    pack = part("battery", BatteryFile, lambda file: (battery_of(file), file.soc))
    gearbox = part("gearbox", GearboxFile, gearbox_of)
    bare = part("car", CarFile, lambda file: partial(vehicle_of, file))
    engine = part("engine", EngineFile, engine_of) or part("source", SourceFile, source_of)
    machines = {key: part(key, MachineFile, machine_of) for key in MACHINES}
    sizes = {key: weighed(file) for key, file in files_of.items() if key in WEIGHED}
    more_kg = _added_kg(path, changes or {}, sizes)
    placed = {key: machine for key, machine in machines.items() if machine is not None}
    # The model has made sure of what every architecture, and every kind of coupling, needs.
    assert pack is not None and bare is not None
    battery, soc = pack
    car = Architecture(
        data.name, data.description, _built(places["car"], bare, data.hybrid_mass_kg + more_kg),
        engine or no_engine(), gearbox, tuple(placed.values()), battery,
        soc_start=soc.start,
        soc_end=soc.start if soc.end is None else soc.end,
        driveline=_driveline(path, data, gearbox, placed),
        functions=frozenset(data.functions),
        thresholds=_thresholds(data.rules),
        gear="cycle",
        contents=contents,
        files=tuple(files),
        weighed=sizes, added_kg=more_kg,
        converter=None if data.converter is None else converter_of(data.converter),
    )  # fmt: skip
    return _as_driven(car, data)


def _as_driven(car: Architecture, data: ArchitectureFile) -> Architecture:
    """The car with what its file says of tyres, clutch, driver, gear changes, and who chooses the gear."""
    handling = handling_of(data.tyre, data.clutch, data.shifting, data.driver, car.shift_gap_s)
    car = replace(car, handling=handling)
    return car.with_free_gear() if data.gear == "free" else car


def _built(place: str, build: Callable[[Given], Built], file: Given) -> Built:
    try:
        return build(file)
    except DataError as error:
        raise DataError(f"{place}: {error}") from None


def _added_kg(path: Path, changes: Mapping[str, Any], sizes: Mapping[str, Weighed]) -> float:
    """What the sizes of a changed architecture weigh more than its own; 0 where those cannot be told."""
    if not resized(changes):
        return 0.0
    try:
        return added_kg(load_architecture(path).weighed, sizes)
    except DataError:
        return 0.0  # a file that is no car before it is changed has no sizes of its own


def _driveline(
    path: Path, data: ArchitectureFile, gearbox: Gearbox | None, machines: Mapping[str, Machine]
) -> Driveline:
    kind = data.coupling.kind
    if kind == "parts":
        try:
            return driveline_of(data.coupling, gearbox)
        except DataError as error:
            raise DataError(f"{path}, coupling: {error}") from None
    options = _options(data.coupling)
    if kind in WITHOUT_GEARBOX:
        return WITHOUT_GEARBOX[kind](kind, options)
    assert gearbox is not None
    if kind == "even_shaft" and len(gearbox.ratios) < 3:
        named = data.gearbox
        file = named.get("file", named) if isinstance(named, Mapping) else named
        raise DataError(
            f"{path}, gearbox: {shown(file)} has 1 gear; coupling kind 'even_shaft' needs 2 "
            "or more; choose another gearbox or kind"
        )
    line = TEMPLATES[kind](kind, options, gearbox, machines["machine"])
    try:
        check_converter(line, gearbox)
    except DataError as error:
        raise DataError(f"{path}, coupling kind {kind!r}: {error}") from None
    return line


def _thresholds(data: RulesFile | None) -> Thresholds:
    if data is None:
        return OPEN
    kmh = data.electric_speed_kmh
    speed_mps = None if kmh is None else kmh * TO_SI["_kmh"][1]
    others = data.model_dump(exclude={"electric_soc", "electric_power_w", "electric_speed_kmh"})
    return Thresholds(data.electric_soc, data.electric_power_w, speed_mps, **others)


def _not_there(path: Path, key: str, changes: Mapping[str, Any]) -> str:
    return (
        f"{path}: change of {printable(f'{key}.{next(iter(changes))}')}: this architecture has no {key}; change "
        "another key"
    )


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
        return kind_of(key) in stem or not any(other in stem for other in COMPONENTS)

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
    return ComponentContents(found, _changed(table, changes, within=f"{key}."), place)


def _changed(
    contents: dict[str, Any], changes: Mapping[str, Any], within: str = ""
) -> dict[str, Any]:
    """Contents that have just been read, with changes; they are copied only where there are any."""
    return with_changes(contents, changes, within) if changes else contents


def _place(place: str, changes: Iterable[str]) -> str:
    """How a message names a file, and what was changed in it."""
    changed = ", ".join(map(printable, changes))
    return f"{place}, with {changed} changed" if changed else place


def _options(data: CouplingFile) -> Options:
    return Options(
        bool(data.second_clutch),
        data.machine_ratio or 1.0,
        data.machine_efficiency or 1.0,
        data.disconnects_above_speed_max,
        data.machine_shift_fuel_g * TO_SI["_g"][1],
        data.planetary_ratio or 1.0,
        data.planetary_efficiency,
        data.final_drive_ratio or 1.0,
        data.final_drive_efficiency,
        data.lock_up_ratio or 1.0,
        data.lock_up_efficiency,
        data.axle_ratio or 1.0,
        data.axle_efficiency,
    )
