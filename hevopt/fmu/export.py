"""Writing a unit: the car's files, a module that PythonFMU loads, its binaries, and the description."""

import hashlib
import uuid
import zipfile
from importlib.resources import files
from io import BytesIO
from pathlib import Path
from xml.etree import ElementTree
from xml.etree.ElementTree import Element, SubElement

import numpy as np
from pythonfmu.fmi2slave import Fmi2Slave

from hevopt import __version__
from hevopt.car.architecture import Architecture
from hevopt.car_files.load import load_architecture
from hevopt.car_files.whole import ARCHITECTURE, texts_of
from hevopt.errors import DataError
from hevopt.files.writing import check_writable, temporary_folder, write_whole
from hevopt.fmu.slave import CAR_FOLDER, STEP_FILE, CarSlave
from hevopt.fmu.variables import UNITS, Given, inputs_of, outputs_of, parameters_of
from hevopt.forward.commanded import CommandedCar
from hevopt.forward.lines import line_of
from hevopt.forward.run import STEP_S, loop_car

_MODULE = "hevopt_unit"
_SOURCE = '''"""The car in the folder beside this file, as a unit; hevopt must be installed where it runs."""

from hevopt.fmu.slave import CarSlave, keep

keep(globals())


class Car(CarSlave):
    """What PythonFMU makes for every instance."""
'''
# The same car gives the same file.
_NEVER = (1980, 1, 1, 0, 0, 0)
_OPTIONS = {"canGetAndSetFMUstate": "true"}


def export_fmu(car: Architecture, out: str | Path, *, step_s: float = STEP_S) -> None:
    """Write a car as a unit of FMI 2.0 for co-simulation.

    step_s: 0.001 to 0.1 s, the unit's own step; a communication step is a whole number of them.
    DataError where the car cannot be driven forward, the step is out of range, the path does not end in .fmu or
    cannot be written, and for a car that was changed after its files were read.
    """
    out = Path(out)
    if out.suffix.lower() != ".fmu":
        raise DataError(f"{out}: must end in .fmu")
    check_writable(out)
    one, texts = CommandedCar(car, step_s=step_s), texts_of(car)
    contents: dict[str, bytes] = {
        f"resources/{CAR_FOLDER}/{name}": text.encode() for name, text in texts.items()
    }
    contents[f"resources/{STEP_FILE}"] = repr(float(step_s)).encode()
    contents[f"resources/{_MODULE}.py"] = _SOURCE.encode()
    contents["resources/slavemodule.txt"] = _MODULE.encode()
    with temporary_folder() as folder:
        for name, data in contents.items():
            path = folder / name
            path.parent.mkdir(parents=True, exist_ok=True)
            path.write_bytes(data)
        _check_same(car, load_architecture(folder / "resources" / CAR_FOLDER / ARCHITECTURE))
        slave = CarSlave(instance_name=_MODULE, resources=str(folder / "resources"))
    contents |= _library(slave.modelName)
    slave.guid = _guid(contents)
    contents["modelDescription.xml"] = _described(slave, one, float(step_s))
    write_whole(out, _zipped(contents))


def _check_same(car: Architecture, read: Architecture) -> None:
    """DataError for a car that its files do not give."""
    if not _same(
        loop_car(car, line_of(car), car.handling), loop_car(read, line_of(read), read.handling)
    ):
        raise DataError(
            f"{car.name}: it was changed after {car.source} was read, which a unit does not take along; make the "
            "changes in load_architecture"
        )


def _same(one: object, other: object) -> bool:
    if isinstance(one, tuple) and isinstance(other, tuple):
        return len(one) == len(other) and all(map(_same, one, other))
    return bool(np.array_equal(np.asarray(one), np.asarray(other), equal_nan=True))


def _library(model: str) -> dict[str, bytes]:
    """PythonFMU's own modules and binaries, these named as the unit."""
    package, found = files("pythonfmu"), {}
    for module in package.iterdir():
        if module.name.endswith(".py"):
            found[f"resources/pythonfmu/{module.name}"] = module.read_bytes()
    for system in package.joinpath("resources", "binaries").iterdir():
        for binary in system.iterdir():
            ending = binary.name.rpartition(".")[2]
            if ending in ("so", "dll", "dylib"):
                found[f"binaries/{system.name}/{model}.{ending}"] = binary.read_bytes()
    return found


def _guid(contents: dict[str, bytes]) -> uuid.UUID:
    digest = hashlib.sha256(__version__.encode())
    for name in sorted(contents):
        digest.update(name.encode() + contents[name])
    return uuid.uuid5(uuid.NAMESPACE_OID, digest.hexdigest())


def _described(slave: Fmi2Slave, one: CommandedCar, step_s: float) -> bytes:
    """PythonFMU's description with what it leaves out: units, limits, and what is known before the first step."""
    root = slave.to_xml(_OPTIONS)
    del root.attrib["generationDateAndTime"]
    root.set("generationTool", f"hevopt {__version__}, {root.get('generationTool')}")
    units = Element("UnitDefinitions")
    for name, bases in UNITS.items():
        base = {unit: str(exponent) for unit, exponent in bases.items()}
        SubElement(SubElement(units, "Unit", name=name), "BaseUnit", base)
    root.insert(1, units)
    at = [child.tag for child in root].index("ModelVariables")
    root.insert(at, Element("DefaultExperiment", startTime="0", stepSize=repr(step_s)))
    given: list[Given] = [*parameters_of(one.car, step_s), *inputs_of(one)]
    known = {each.name: each for each in given} | {each.name: each for each in outputs_of(one)}
    unknowns = SubElement(_child(root, "ModelStructure"), "InitialUnknowns")
    for n, variable in enumerate(_child(root, "ModelVariables"), 1):
        own, kind = known[variable.attrib["name"]], variable[0]
        if own.unit:
            kind.set("unit", own.unit)
        if not isinstance(own, Given):
            SubElement(unknowns, "Unknown", index=str(n))
            continue
        kind.set("start", str(own.start).lower())
        for name, value in (("min", own.low), ("max", own.high)):
            if value is not None:
                kind.set(name, str(value))
    ElementTree.indent(root)
    described: bytes = ElementTree.tostring(root, encoding="UTF-8", xml_declaration=True)
    return described


def _child(root: Element, tag: str) -> Element:
    found = root.find(tag)
    assert found is not None  # PythonFMU writes both
    return found


def _zipped(contents: dict[str, bytes]) -> bytes:
    whole = BytesIO()
    with zipfile.ZipFile(whole, "w", zipfile.ZIP_DEFLATED) as archive:
        for name in sorted(contents):
            info = zipfile.ZipInfo(name, _NEVER)
            info.compress_type = zipfile.ZIP_DEFLATED
            archive.writestr(info, contents[name])
    return whole.getvalue()
