"""MATLAB files of version 7.3: read in a process of their own, so that a spoilt one is a message and no crash."""

import random
import subprocess
from pathlib import Path

import h5py
import numpy as np
import pytest

from hevopt.errors import DataError
from hevopt.measured.cycles.cycle import import_cycle
from hevopt.measured.maps.tables import Source, read_table
from hevopt.measured.tables import hdf5 as measured_hdf5
from hevopt.measured.tables.table import read_measured

HEAD = b"MATLAB 7.3 MAT-file, Platform: GLNXA64, Created on: Thu May  9 2024 HDF5 schema 1.00 ."
TIME_S = np.arange(20.0)
DRIVE = {"cyc_mph": np.column_stack([TIME_S, 20 + TIME_S])}


def of_class(group: h5py.Group, name: str, values: np.ndarray, kind: str = "double"):
    """A variable as MATLAB stores it: axes the other way round, its class as an attribute."""
    made = group.create_dataset(name, data=np.atleast_2d(values).T)
    made.attrs["MATLAB_class"] = np.bytes_(kind)
    return made


def written(path: Path, variables=None, more=None) -> Path:
    with h5py.File(path, "w", userblock_size=512) as file:
        for name, values in (variables or {}).items():
            of_class(file, name, values)
        if more is not None:
            more(file)
    with path.open("r+b") as file:
        file.write(HEAD.ljust(124) + b"\0\2IM")
    return path


def columns(path: Path) -> dict[str, np.ndarray]:
    return {column.name: column.values for column in read_measured(path).columns}


def test_a_cycle_is_read(tmp_path):
    cycle = import_cycle(written(tmp_path / "log.mat", DRIVE)).cycle
    assert cycle.speed_mps[:20] == pytest.approx((20 + TIME_S) * 0.44704)


def test_a_map_of_axes_and_matrix_is_read_the_right_way_round(tmp_path):
    speed, torque = np.array([1000.0, 2000, 3000]), np.array([10.0, 20, 30, 40])
    fuel = np.outer(speed, torque) * 1e-5
    axes = {"speed_rpm": speed, "torque_nm": torque, "fuel_gps": fuel}
    table = read_table(Source(written(tmp_path / "m.mat", axes), None, {}, {}, None), "fuel")
    assert table.values["fuel"] * 1e3 == pytest.approx(fuel.ravel())
    assert table.values["torque"][:4] == pytest.approx(torque)


def test_fields_integers_and_truth_values_are_read_and_the_rest_is_named(tmp_path):
    def more(file):
        of_class(file.create_group("s"), "speed_kmh", np.arange(5.0))
        of_class(file, "gear", np.arange(5, dtype=np.int8), "int8")
        of_class(file, "on", np.array([0, 1, 1, 0, 1], dtype=np.uint8), "logical")
        of_class(file, "text", np.arange(5, dtype=np.uint16), "char")
        of_class(file, "nothing", np.array([0.0, 0]), "double").attrs["MATLAB_empty"] = np.uint8(1)
        file["complex"] = np.arange(5) * 1j
        file["ragged"] = np.zeros((2, 2, 2))
        file.create_group("#refs#")["a"] = np.arange(5.0)
        file["outside"] = h5py.ExternalLink("/dev/zero", "/x")
        file["soft"] = h5py.SoftLink("/gear")
        file["plain"] = np.arange(5.0)

    found = columns(written(tmp_path / "m.mat", more=more))
    assert {*found} == {"s.speed_kmh", "gear", "on", "plain"}
    assert found["gear"].tolist() == [0, 1, 2, 3, 4] and found["on"].tolist() == [0, 1, 1, 0, 1]
    notes = " ".join(read_measured(tmp_path / "m.mat").notes)
    assert "text (no real numbers)" in notes and "complex" in notes and "refs" not in notes


def test_what_is_larger_unpacked_than_allowed_is_not_unpacked(tmp_path):
    def more(file):
        file.create_dataset("big", (30_000, 1000), "f8", chunks=True, compression="gzip")

    with pytest.raises(DataError, match="more than 200 MB unpacked; save fewer variables"):
        read_measured(written(tmp_path / "big.mat", more=more))


def test_without_h5py_the_message_says_what_to_do(tmp_path, monkeypatch):
    monkeypatch.setattr(measured_hdf5, "find_spec", lambda _: None)
    with pytest.raises(DataError, match=r"needs h5py; run: pip install .*save\(..., '-v7'\)"):
        read_measured(written(tmp_path / "log.mat", DRIVE))


@pytest.mark.parametrize("contents", [HEAD, b"\x89HDF\r\n\x1a\n", HEAD + bytes(3000)])
def test_what_is_no_hdf5_file_is_one_message(tmp_path, contents):
    path = tmp_path / "a.mat"
    path.write_bytes(contents)
    with pytest.raises(DataError, match=r"not a readable \.mat file of version 7\.3"):
        read_measured(path)


@pytest.mark.parametrize(
    ("program", "why"),
    [
        ("import os; os.abort()", "status -6"),
        ("while True: pass", r"status -(9|24)"),
        ("x = bytearray(6_000_000_000)", "status 1"),
        ("import time; time.sleep(60)", "TimeoutExpired"),
    ],
)
def test_a_reader_that_crashes_hangs_or_eats_memory_is_one_message(
    tmp_path, monkeypatch, program, why
):
    # The child's limits, with the library's mischief in place of the library.
    child = tmp_path / "child.py"
    text = Path(measured_hdf5._CHILD).read_text()
    for old, new in (("_CPU_MAX_S = 8", "_CPU_MAX_S = 2"), ("    written = 0", f"    {program}")):
        text = text.replace(old, new)
    assert program in text and "_CPU_MAX_S = 2" in text
    child.write_text(text)
    monkeypatch.setattr(measured_hdf5, "_CHILD", child)
    if "sleep" in program:
        monkeypatch.setattr(measured_hdf5, "_TIMEOUT_S", 0.2)
    with pytest.raises(DataError, match=why):
        read_measured(written(tmp_path / "log.mat", DRIVE))


def test_spoilt_files_are_tables_or_one_message(tmp_path):
    whole, path = written(tmp_path / "whole.mat", DRIVE).read_bytes(), tmp_path / "spoilt.mat"
    refused = 0
    for case in range(12):
        rng, spoilt = random.Random(case), bytearray(whole)
        for _ in range(30):
            spoilt[rng.randrange(512, len(spoilt))] = rng.choice((0, 255, rng.randrange(256)))
        path.write_bytes(bytes(spoilt))
        try:
            read_measured(path)
        except DataError as error:
            assert str(error).count(str(path)) == 1
            refused += 1
    assert refused


def test_the_reader_leaves_nothing_running(tmp_path, monkeypatch):
    seen = []
    real = subprocess.Popen

    def noted(*words, **terms):
        seen.append(real(*words, **terms))
        return seen[-1]

    monkeypatch.setattr(subprocess, "Popen", noted)
    monkeypatch.setattr(measured_hdf5, "_TIMEOUT_S", 0.0)
    with pytest.raises(DataError, match="TimeoutExpired"):
        read_measured(written(tmp_path / "log.mat", DRIVE))
    assert seen[0].poll() is not None
