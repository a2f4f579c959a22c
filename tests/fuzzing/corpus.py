"""Good files of every kind that hevopt reads, and the command that reads each: what the fuzzer starts from."""

import re
from collections.abc import Sequence
from functools import cache

from fuzzing.measured import measured
from fuzzing.results import results
from fuzzing.seed import ARCHITECTURES, COMPONENTS, CYCLES, SHORT_CYCLE, Seed


@cache
def seeds() -> list[Seed]:
    """One or more of every kind."""
    return [*_own_files(), *measured(), *_studies(), *results()]


def _own_files() -> list[Seed]:
    validate, baseline = ("validate",), ("run", "A", "--strategy", "baseline", "--cycle")
    nedc = "\n".join((CYCLES / "nedc.csv").read_text().splitlines()[:220]) + "\n"
    files = [
        Seed(
            "drive.csv",
            nedc.encode(),
            (_with(validate, "drive.csv"), _with(baseline, "./drive.csv")),
        )
    ]
    for name in ("A", "C2", "D", "E"):
        text = (ARCHITECTURES / f"{name}.toml").read_bytes()
        run = ("run", "./car.toml", "--strategy", "conventional" if name != "A" else "baseline",
               "--cycle", str(SHORT_CYCLE), "--allow-shortfall")  # fmt: skip
        new = ("architectures", "new", "mine", "--like", "./car.toml", "--components", "all")
        files.append(Seed("car.toml", text, (_with(validate, "car.toml"), run, new)))
    parts = [(path.stem, path.read_bytes()) for path in sorted(COMPONENTS.glob("*.toml"))]
    for name, contents in [*parts, *_with_measured_maps()]:
        key = name.split("_")[0]
        run = ("run", "C2" if key not in ("machine",) else "D", "--strategy", "ecms", "--cycle",
               str(SHORT_CYCLE), "--allow-shortfall", "--set", f'{key}="./part.toml"')  # fmt: skip
        files.append(Seed("part.toml", contents, (_with(validate, "part.toml"), run)))
    return files


def _with_measured_maps() -> list[tuple[str, bytes]]:
    """The shipped engine and a machine with maps in place of their coefficients."""
    rpm, torque = [800.0, 2000.0, 3500.0, 5000.0], [0.0, 60.0, 150.0, 290.0]
    fuel = [[0.05 + t * n * 7e-6 for t in torque] for n in rpm]
    engine = _without(
        (COMPONENTS / "engine_diesel_1600.toml").read_text(),
        ("fuel_coefficients", "nox_coefficients"),
    )
    engine += f"""
[fuel_map]
speed_rpm = {rpm}
torque_nm = {torque}
fuel_gps = {fuel}
nox_gps = {[[x / 100 for x in row] for row in fuel]}
motoring_torque_nm = [-15.0, -20.0, -30.0, -45.0]
"""
    machine = """name = "measured machine"
kind = "map"
power_max_w = 15e3
torque_max_nm = 60.0
speed_max_rpm = 18000.0
inertia_kgm2 = 0.01
[loss_map]
speed_rpm = [0.0, 6000.0, 18000.0]
torque_nm = [0.0, 20.0, 60.0]
loss_w = [[10.0, 60.0, nan], [60.0, 150.0, 900.0], [300.0, 500.0, nan]]
symmetric = true
"""
    return [("engine_measured", engine.encode()), ("machine_measured", machine.encode())]


def _without(text: str, tables: Sequence[str]) -> str:
    """TOML without some tables."""
    parts = re.split(r"(?m)^(?=\[)", text)
    return "".join(part for part in parts if part[1 : part.find("]")] not in tables)


def _studies() -> list[Seed]:
    compare = f"""cycle = "{SHORT_CYCLE}"
architectures = ["A", "C2"]
strategies = ["conventional"]
nox_weight = 5.0
mass_kg = 1350
[set]
"battery.soc.start" = 0.55
"engine.scale.torque" = 1.1
"""
    sweep = f"""architecture = "C2"
cycles = ["{SHORT_CYCLE}"]
strategies = ["bound"]
constraints = ["battery.cells_in_series * 730 >= machine.power_max_w"]
[parameters]
battery.cells_in_series = {{ from = 32, to = 64, count = 2 }}
machine.power_max_w = {{ from = 8e3, to = 3e4, count = 2, log = true }}
engine = ["engine_diesel_1600", "engine_diesel_1600_steep_nox"]
nox_weight = [0, 10]
[sample]
method = "sobol"
count = 4
seed = 1
"""
    return [
        Seed("study.toml", compare.encode(), (("validate", "study.toml"), ("compare", "study.toml"))),
        Seed("sweep.toml", sweep.encode(), (("validate", "sweep.toml"), ("sweep", "sweep.toml", "--dry-run"))),
    ]  # fmt: skip


def _with(words: Sequence[str], name: str) -> Sequence[str]:
    return (*words, name)
