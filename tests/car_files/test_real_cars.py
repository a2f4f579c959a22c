"""Real cars: every figure has source and status, and the wheels take what coefficients and test weight say."""

import re
import tomllib
from functools import cache

import numpy as np
import pytest
import tomlkit
from tomlkit import items

from hevopt import load_architecture, load_cycle
from hevopt.driving.demand import demand_of
from hevopt.files.lookup import shipped_folder

REAL = shipped_folder("architectures") / "real"
CARS = sorted(path.stem for path in REAL.glob("*.toml"))
FILES = sorted([*REAL.glob("*.toml"), *REAL.glob("components/*.toml")])
STATUS = re.compile(r"\[[SDFE]\b")
SOURCES = {"EPA", "FASTSim", "ADVISOR", "Press", "Gears", "Source A", "SAE"}


def figures(container, pending, head=""):
    """Key path of every number below a container, with what is said beside it or above it.

    What is said at a table speaks for its figures where none of them has a comment of its own.
    pending: comments read and not yet said of anything; those above a table stand at the end of the one before
    """
    found, inner = [], []
    for key, item in container.body:
        if isinstance(item, items.Comment):
            pending.append(item.as_string())
        elif key is not None:
            said = " ".join([*pending, item.trivia.comment]).strip()
            pending.clear()
            if isinstance(item, items.Table):
                below = figures(item.value, pending, said)
                inner += [(f"{key.key}.{path}", text) for path, text in below]
            elif re.search(r"\d", re.sub(r'"[^"]*"', "", item.as_string())):
                found.append((key.key, said))
    if not any(said for _, said in found):
        found = [(path, head) for path, _ in found]
    return found + inner


def without_source(text):
    """Figures of a file to which it gives no status, or a published one without a name of where it is from."""
    document = tomlkit.parse(text)
    named = text.split("\nname = ")[0]
    bad = []
    for path, said in figures(document, []):
        own = STATUS.findall(said)
        sourced = "[E" in said or any(source in said for source in SOURCES) or "http" in said
        sourced = sourced or bool(
            re.search(r"\w+\.(com|ca|co\.za|online|net)\b|maker|unit|in its file", said)
        )
        sourced = sourced or ("Source A" in named and "[S" in said)
        if not own or not sourced:
            bad.append(path)
    return bad


@pytest.mark.parametrize("path", FILES, ids=lambda path: path.name)
def test_every_figure_has_source_and_status(path):
    assert not without_source(path.read_text())


def test_a_figure_without_source_or_status_is_found():
    text = (REAL / "prius_2016.toml").read_text()
    line = "speed_max_rpm = 10000              # [S] Gears"
    assert without_source(text.replace(line, "speed_max_rpm = 10000")) == ["machine.speed_max_rpm"]
    assert without_source(text.replace(line, f"{line[:-6]}")) == ["machine.speed_max_rpm"]
    assert without_source("a = 1 # [S]") == ["a"] == without_source("a = 1 # EPA")
    assert without_source("# [S] EPA\n[t]\nb = [1, 2]\n[u]\nc = 3\n") == ["u.c"]


@pytest.mark.parametrize("car", CARS)
def test_the_components_of_a_real_car_are_shipped_ones_or_its_own(car):
    found = load_architecture(car)
    folders = {
        path.parent.relative_to(shipped_folder("architectures")).as_posix() for path in found.files
    }
    assert folders <= {"real", "real/components", "components"}
    assert tomllib.loads((REAL / f"{car}.toml").read_text())["name"] == car


@cache
def measured():
    lines = (REAL / "measured.csv").read_text().splitlines()
    rows = [line.split(",") for line in lines if not line.startswith("#")][1:]
    return sorted({(row[0], row[1]) for row in rows})


def test_every_real_car_was_measured_and_every_test_has_status_and_source():
    assert {car for car, _ in measured()} == set(CARS) and len(CARS) >= 8
    for line in (REAL / "measured.csv").read_text().splitlines():
        if not line.startswith("#"):
            assert re.search(r",(status|[SD]),\"?(source|\S.{5,})", line)


@pytest.mark.parametrize("car, cycle", measured())
def test_wheels_take_what_coefficients_and_test_weight_say(car, cycle):
    """Within 1 %, by an integral that shares no code with the model, over steps of a fiftieth of a second."""
    parts = tomllib.loads((REAL / "components" / f"car_{car}.toml").read_text())
    load, mass = parts["road_load"], parts["mass_kg"]
    if "coastdown_c0_n" in load:
        a, b, c = (load[f"coastdown_{key}"] for key in ("c0_n", "c1_nspm", "c2_ns2pm2"))
        assert parts["wheel_inertia_kgm2"] == 0
    else:
        a, b, c = 9.81 * mass * load["rolling_c0"], 0.0, 0.6 * load["drag_area_m2"]
        mass += parts["wheel_inertia_kgm2"] / parts["tyre_radius_m"] ** 2
    trace = load_cycle(cycle)
    fine = np.arange(trace.time_s[0], trace.time_s[-1], 0.02)
    speed = np.interp(fine, trace.time_s, trace.speed_mps)
    middle = (speed[1:] + speed[:-1]) / 2
    power = (a * (middle > 0) + b * middle + c * middle**2 + mass * np.diff(speed) / 0.02) * middle
    found = load_architecture(car)
    model = demand_of(trace, found.vehicle, found.gearbox).wheel_work_jpm
    assert model == pytest.approx(np.maximum(power, 0).sum() * 0.02 / trace.distance_m, rel=0.01)
