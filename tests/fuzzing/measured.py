"""Good files that others' tools wrote: logged drives, maps of engines and machines, coast-down runs."""

import io
from collections.abc import Sequence
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
from fuzzing.seed import Seed, each_spoilt

_WORKBOOKS = Path(__file__).parents[1] / "measured" / "workbooks"


def measured() -> list[Seed]:
    """Of every kind and form that is imported."""
    return [*_logs(), *_maps(), *_coastdowns()]


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
    clock = np.where(time < 30, 235_930 + time, np.where(time < 90, time - 30, time + 10))
    head = (
        "[header]\nsatellites\ntime\nvelocity kmh\n\n[column names]\nsats time velocity\n\n[data]"
    )
    texts["vbox.vbo"] = table(head, "{:03.0f} {:09.2f} {:07.3f}", 0 * time + 8, clock, speed * 3.6)
    form = '"{0:.1f}";"Engine RPM";"{1:.0f}";"rpm";\n"{0:.2f}";"Vehicle speed";"{2:.2f}";"km/h";'
    texts["signals.csv"] = table(
        '"SECONDS";"PID";"VALUE";"UNITS";', form, time, 900 + time, speed * 3.6
    )
    pairs = zip(time.tolist(), (speed * 3.6).tolist(), strict=True)
    texts["log.xlsx"] = _workbook([["time [s]", "speed [km/h]"], *pairs])
    cycle = {"cyc_mph": np.column_stack([time, speed / 0.44704])}
    texts |= {"log.mat": _matlab(cycle), "log73.mat": _matlab_73(cycle)}
    texts["log.xls"] = (_WORKBOOKS / "drive.xls").read_bytes()
    return [
        Seed(name, text, ((*read, name, "--out", "o.csv"), (*read, name, "--repair", "--out", "o.csv")))
        for name, text in texts.items()
    ]  # fmt: skip


def _maps() -> list[Seed]:
    rpm, torque = np.meshgrid(np.arange(800, 4801, 400.0), np.arange(0, 251, 25.0), indexing="ij")
    fuel_gps = 0.05 + torque * rpm / 9549.3 * 0.06
    loss_w = 50 + 0.003 * rpm + 0.2 * (torque / 3) ** 2
    engine = _table(
        "speed [rpm],torque [Nm],fuel [g/s],nox [g/s]", rpm, torque, fuel_gps, fuel_gps * 0.01
    )
    machine = _table("speed [rpm],torque [Nm],loss [W]", rpm, torque / 3, loss_w)
    curve = np.arange(800, 4801, 400.0)
    curves = {
        "motoring.csv": _table("n [rpm],drag [Nm]", curve, -15 - curve / 200),
        "full.csv": _table("n [rpm],T [Nm]", curve, 250 - (curve - 2400) ** 2 / 1e5),
    }
    like = ("--kind", "engine", "--like", "engine_diesel_1600", "--out", "part.toml")
    machine_like = ("--kind", "machine", "--like", "machine_flywheel_18kw", "--out", "part.toml")
    extra = ("--motoring", "motoring.csv", "--full-load", "full.csv")
    read = ("maps", "import")
    grids = {name: _grid(rpm[:, 0], torque[0, 1:], values[:, 1:], head) for name, values, head in (
        ("grid.csv", fuel_gps, "n [rpm] \\ T [Nm]"), ("nox.csv", fuel_gps * 0.01, "n [rpm] \\ T [Nm]"),
    )}  # fmt: skip
    units = ("--unit", "fuel=g/s", "--unit", "nox=g/s")
    seeds = [
        Seed("engine.csv", engine, ((*read, "engine.csv", *like),)),
        Seed("machine.csv", machine, ((*read, "machine.csv", *machine_like),)),
        *each_spoilt({"engine.csv": engine, **curves}, (*read, "engine.csv", *like, *extra)),
        *each_spoilt({**grids, **curves}, (*read, "grid.csv", *like, *extra, "--nox", "nox.csv", *units)),
        *each_spoilt({"machine.csv": machine, "full.csv": curves["full.csv"]},
                     (*read, "machine.csv", *machine_like, "--full-load", "full.csv")),
    ]  # fmt: skip
    columns = {"speed_rpm": rpm, "torque_nm": torque, "fuel_gps": fuel_gps}
    axes = {
        "fc_map_spd": rpm[:, 0] * np.pi / 30, "fc_map_trq": torque[0], "fc_fuel_map": fuel_gps,
        "fc_max_trq": 250 - (rpm[:, 0] - 2400) ** 2 / 1e5,
    }  # fmt: skip
    for name, contents in (
        ("map.mat", _matlab({key: values.ravel() for key, values in columns.items()})),
        ("axes.mat", _matlab(axes)),
        ("axes73.mat", _matlab_73(axes)),
        ("map.xls", (_WORKBOOKS / "map.xls").read_bytes()),
        ("map.xlsx", _workbook([["speed [rpm]", "torque [Nm]", "fuel [g/s]"],
                                *zip(*(v.ravel().tolist() for v in columns.values()), strict=True)])),
    ):  # fmt: skip
        seeds.append(Seed(name, contents, ((*read, name, *like),)))
    return seeds


def _table(head: str, *columns: np.ndarray) -> bytes:
    rows = zip(*(column.ravel() for column in columns), strict=True)
    return "\n".join([head, *(",".join(f"{x:.6g}" for x in row) for row in rows), ""]).encode()


def _grid(rows: np.ndarray, columns: np.ndarray, values: np.ndarray, head: str) -> bytes:
    lines = [",".join([head, *(f"{x:g}" for x in columns)])]
    lines += [
        ",".join([f"{row:g}", *(f"{x:.6g}" for x in cells)])
        for row, cells in zip(rows, values, strict=True)
    ]
    return ("\n".join(lines) + "\n").encode()


def _workbook(rows: list[Sequence[object]]) -> bytes:
    from openpyxl import Workbook

    book, stream = Workbook(), io.BytesIO()
    for row in rows:
        book.active.append(list(row))
    book.save(stream)
    return stream.getvalue()


def _matlab(variables: dict[str, np.ndarray]) -> bytes:
    from scipy.io import savemat

    stream = io.BytesIO()
    savemat(stream, variables)
    return stream.getvalue()


def _matlab_73(variables: dict[str, np.ndarray]) -> bytes:
    """As MATLAB writes version 7.3: HDF5 behind a head of 512 bytes, axes the other way round."""
    import h5py

    with TemporaryDirectory(prefix="hevopt-fuzz-") as folder:
        path = Path(folder) / "made.mat"
        with h5py.File(path, "w", userblock_size=512) as file:
            for name, values in variables.items():
                made = file.create_dataset(name, data=np.atleast_2d(values).T)
                made.attrs["MATLAB_class"] = np.bytes_("double")
        return b"MATLAB 7.3 MAT-file".ljust(124) + b"\0\2IM" + path.read_bytes()[128:]


def _coastdowns() -> list[Seed]:
    lines = ["time [s],speed [km/h],run,direction"]
    for run in range(4):
        speed, time = 33.0, 0.0
        while speed > 4:
            lines.append(f"{time:g},{speed * 3.6:.3f},{run + 1},{'ab'[run % 2]}")
            speed -= (120 + 2 * speed + (0.4 + 0.01 * run) * speed**2) / 1400
            time += 1.0
    words = (
        "coastdown",
        "runs.csv",
        "--mass-kg",
        "1350",
        "--like",
        "car_compact",
        "--out",
        "car.toml",
    )
    bare = [line.rsplit(",", 2)[0] for line in lines]
    return [
        Seed("runs.csv", ("\n".join(lines) + "\n").encode(), (words,)),
        Seed("runs.csv", ("\n".join(bare) + "\n").encode(), ((*words, "--directions", "+,-,+,-"),)),
    ]
