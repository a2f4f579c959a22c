"""A test bench on which the shipped engine is measured, and the files it writes."""

import tomllib
from math import pi
from pathlib import Path

import numpy as np

from hevopt import load_architecture
from hevopt.files.lookup import shipped_folder

SHIPPED = shipped_folder("architectures")
RPM = pi / 30
SPEEDS = (850, 1000, 1250, 1500, 1750, 2000, 2250, 2500, 2750, 3000, 3250, 3500, 4000, 4500, 5000)
TORQUES = (0, 5, 10, 20, 30, 45, 60, 80, 100, 125, 150, 175, 200, 225, 250, 270)
LIKE = ("--like", "engine_diesel_1600")
OWN = (
    "--displacement-cm3",
    "1598",
    "--set",
    "fuel.heating_value_mjpkg=42.9",
    "--set",
    "fuel.density_kgpl=0.835",
)
FUEL = ("--set", "fuel={heating_value_mjpkg=42.9,density_kgpl=0.835,co2_kgpkg=3.16}")
ENGINE = load_architecture("A").engine
HEAT_JPKG = 42.9e6


def bench(torques=TORQUES, full: bool = True, wander_rpm: float = 0.0) -> np.ndarray:
    """(point, 4) rpm, Nm, fuel and NOx in g/h of the shipped engine, as a bench measures it: line by line."""
    rng, rows = np.random.default_rng(1), []
    for rpm in SPEEDS:
        top = float(ENGINE.full_load_nm(np.array(rpm * RPM)))
        for torque in [t for t in torques if t < top] + [top] * full:
            held = rpm + rng.uniform(-wander_rpm, wander_rpm)
            at = np.array(float(torque)), np.array(held * RPM)
            flows = ENGINE.fuel_kgps(*at), ENGINE.nox_kgps(*at)
            rows.append([held, torque, *(float(flow) * 3.6e6 for flow in flows)])
    return np.array(rows)


def write(path: str, header: str, *columns) -> None:
    rows = [
        ",".join("" if np.isnan(x) else f"{x:.9g}" for x in row)
        for row in zip(*columns, strict=True)
    ]
    Path(path).write_text("\n".join([header, *rows]) + "\n")


def write_motoring(path: str = "motoring.csv") -> None:
    rpm = np.array([850, 1000, 1500, 2000, 2500, 3000, 3500, 4000, 4500, 5000])
    write(path, "n [rpm],drag [Nm]", rpm, ENGINE.drag_nm(rpm * RPM))


def component(path: str = "bench.toml") -> dict:
    return tomllib.loads(Path(path).read_text())


def car_with(key: str, file: str, name: str = "C2") -> str:
    """A shipped architecture with another engine or machine, named after both."""
    text = (SHIPPED / f"{name}.toml").read_text(encoding="utf-8")
    lines = []
    for line in text.splitlines():
        word, _, rest = line.partition(" = ")
        if word == key:
            line = f'{key} = "{Path(file).resolve()}"'
        elif word == "name":
            line = f'name = "{name} {key}"'
        elif word in ("car", "engine", "gearbox", "machine", "battery"):
            part = rest.split('"')[1]
            line = f'{word} = "{SHIPPED}/components/{part}.toml"'
        lines.append(line)
    path = f"{name}_{key}.toml"
    Path(path).write_text("\n".join(lines) + "\n")
    return f"./{path}"
