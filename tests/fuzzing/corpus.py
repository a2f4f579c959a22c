"""Good files of every kind that hevopt reads, and the command that reads each: what the fuzzer starts from."""

import io
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

ROOT = Path(__file__).parents[2]
ARCHITECTURES, CYCLES = ROOT / "architectures", ROOT / "cycles"
SHORT_CYCLE = Path(__file__).parent / "short.csv"


@dataclass(frozen=True)
class Seed:
    """A file, and sets of words after `hevopt` that read it."""

    name: str
    contents: bytes
    commands: tuple[Sequence[str], ...]


def seeds() -> list[Seed]:
    """One or more of every kind."""
    return [*_own_files(), *_logs(), *_maps(), *_coastdowns(), *_studies()]


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
        files.append(Seed("car.toml", text, (_with(validate, "car.toml"), run)))
    for path in sorted((ARCHITECTURES / "components").glob("*.toml")):
        key = path.stem.split("_")[0]
        run = ("run", "C2" if key not in ("machine",) else "D", "--strategy", "ecms", "--cycle",
               str(SHORT_CYCLE), "--allow-shortfall", "--set", f'{key}="./part.toml"')  # fmt: skip
        files.append(Seed("part.toml", path.read_bytes(), (_with(validate, "part.toml"), run)))
    return files


def _logs() -> list[Seed]:
    time = np.arange(0, 90, 1.0)
    speed = 12 * np.sin(np.pi * time / 89) ** 2
    read = ("cycles", "import")
    table = lambda head, form, *columns: (  # noqa: E731
        head + "\n" + "\n".join(form.format(*row) for row in zip(*columns, strict=True)) + "\n"
    ).encode()
    texts = {
        "fastsim.csv": table("cycSecs,cycMps,cycGrade", "{:g},{:.4f},{:.3f}", time, speed, 0 * time + 0.01),
        "vecto.vdri": table("<t>,<v>,<grad>", "{:g},{:.3f},{:.2f}", time, speed * 3.6, 0 * time),
        "vecto_s.vdri": table("<s>,<v>,<stop>,<grad>", "{:g},{:.3f},{:g},{:.2f}", time * 10,
                              np.clip(speed * 3.6, 1, None), 0 * time, 0 * time),
        "excel.csv": table("Zeit [s];Geschwindigkeit [km/h]", "{:g};{:.2f}", time, speed * 3.6).replace(b".", b","),
        "units_row.tsv": table("time\tspeed\ns\tmph", "{:g}\t{:.3f}", time, speed / 0.44704),
        "dynaprog.csv": table("time_s,speed_kmh", "{:.1f},{:.3f}", time + 0.1 * np.sin(time), speed * 3.6),
    }  # fmt: skip
    from openpyxl import Workbook
    from scipy.io import savemat

    book, stream = Workbook(), io.BytesIO()
    book.active.append(["time [s]", "speed [km/h]"])
    for pair in zip(time.tolist(), (speed * 3.6).tolist(), strict=True):
        book.active.append(list(pair))
    book.save(stream)
    texts["log.xlsx"] = stream.getvalue()
    stream = io.BytesIO()
    savemat(stream, {"cyc_mph": np.column_stack([time, speed / 0.44704])})
    texts["log.mat"] = stream.getvalue()
    return [
        Seed(name, text, ((*read, name, "--out", "o.csv"), (*read, name, "--repair", "--out", "o.csv")))
        for name, text in texts.items()
    ]  # fmt: skip


def _maps() -> list[Seed]:
    rpm, torque = np.meshgrid(np.arange(800, 4801, 400.0), np.arange(0, 251, 25.0), indexing="ij")
    rpm, torque = rpm.ravel(), torque.ravel()
    fuel_gps = (0.05 + torque * rpm / 9549.3 * 0.06) * 1.0
    engine = "speed [rpm],torque [Nm],fuel [g/s],nox [g/s]\n" + "".join(
        f"{n:g},{t:g},{f:.4f},{f * 0.01:.5f}\n"
        for n, t, f in zip(rpm, torque, fuel_gps, strict=True)
    )
    loss = 50 + 0.003 * rpm + 0.2 * (torque / 3) ** 2
    machine = "speed [rpm],torque [Nm],loss [W]\n" + "".join(
        f"{n:g},{t / 3:.3f},{w:.3f}\n" for n, t, w in zip(rpm, torque, loss, strict=True)
    )
    words = lambda name, kind, like: (  # noqa: E731
        ("maps", "import", name, "--kind", kind, "--like", like, "--out", "part.toml"),
    )
    return [
        Seed("engine.csv", engine.encode(), words("engine.csv", "engine", "engine_diesel_1600")),
        Seed("machine.csv", machine.encode(), words("machine.csv", "machine", "machine_flywheel_18kw")),
    ]  # fmt: skip


def _coastdowns() -> list[Seed]:
    lines = ["time [s],speed [km/h],run,direction"]
    for run in range(4):
        speed, time = 33.0, 0.0
        while speed > 4:
            lines.append(f"{time:g},{speed * 3.6:.3f},{run + 1},{'ab'[run % 2]}")
            speed -= (120 + 2 * speed + (0.4 + 0.01 * run) * speed**2) / 1400
            time += 1.0
    words = ("coastdown", "runs.csv", "--mass-kg", "1350", "--out", "car.toml")
    return [Seed("runs.csv", ("\n".join(lines) + "\n").encode(), (words,))]


def _studies() -> list[Seed]:
    compare = f"""cycle = "{SHORT_CYCLE}"
architectures = ["A", "C2"]
strategies = ["conventional"]
nox_weight = 5.0
[set]
"battery.soc.start" = 0.55
"car.mass_kg" = 1400
"""
    sweep = f"""architecture = "C2"
cycles = ["{SHORT_CYCLE}"]
strategies = ["bound"]
constraints = ["battery.cells_in_series * 730 >= machine.power_max_w"]
[parameters]
battery.cells_in_series = {{ from = 32, to = 64, count = 2 }}
machine.power_max_w = {{ from = 8e3, to = 3e4, count = 2, log = true }}
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
