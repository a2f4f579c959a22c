"""Tables in files: what is written reads back to the same bits, whatever the suffix."""

import csv
import json
import struct
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from command_line import call
from hypothesis import given, settings
from hypothesis import strategies as st

from hevopt import DataError, build_problem, load_architecture, load_cycle, simulate, solve
from hevopt.files.frames import csv_of
from hevopt.output import file_tables as outputs
from hevopt.pages.comparison.saved import load_results
from hevopt.studies.comparison import Comparison
from hevopt.studies.rows import Row
from hevopt.studies.status import OK, Status

SHORT = "time_s,speed_kmh\n0,0\n5,0\n15,40\n40,40\n50,0\n60,0\n70,50\n110,50\n125,0\n130,0\n"
ABOUT = {"inputs": {"a.toml": "0f"}, "versions": {"hevopt": "0"}, "settings": {"nox_weight": 0.0}}


@pytest.fixture
def hevopt(monkeypatch, capsys, tmp_path):
    """The command line in an empty folder with a short cycle."""
    monkeypatch.chdir(tmp_path)
    Path("short.csv").write_text(SHORT)
    return lambda *words: call(monkeypatch, capsys, *words)


def read(path: Path) -> list[dict]:
    """The lines of a table, by whichever reader others use for such a file."""
    if path.suffix == ".csv":
        with path.open(newline="") as file:
            return list(csv.DictReader(file))
    if path.suffix == ".json":
        whole = json.loads(path.read_text(), parse_constant=lambda word: pytest.fail(word))
        return whole.get("steps", whole["rows"])
    from pyarrow import parquet

    return parquet.read_table(path).to_pylist()


def bits(value) -> bytes:
    return struct.pack("<d", float(value))


@pytest.mark.parametrize("suffix", [".csv", ".parquet", ".json"])
def test_steps_read_back_to_the_same_bits_inputs_and_outputs_together(hevopt, suffix):
    path = Path(f"steps{suffix}")
    assert hevopt("run", "C2", "--cycle", "short.csv", "--out", str(path))[0] == 0
    lines, cycle = read(path), load_cycle("short.csv")
    problem = build_problem(load_architecture("C2"), cycle)
    trajectory = simulate(problem, solve(problem).control)
    assert len(lines) == len(cycle.time_s) - 1
    for name, values in {
        "speed_start_mps": cycle.speed_mps[:-1], "speed_end_mps": cycle.speed_mps[1:], "grade": cycle.grade[:-1],
        "fuel_kg": trajectory.fuel_kg, "soc_start": trajectory.soc[:-1], "soc_end": trajectory.soc[1:],
        "engine_torque_nm": trajectory.flows["engine_torque_nm"], "nox_kg": trajectory.nox_kg,
    }.items():  # fmt: skip
        assert [bits(line[name]) for line in lines] == [bits(value) for value in values], name
    assert float(lines[-1]["distance_end_m"]) == pytest.approx(cycle.distance_m, rel=1e-12)
    assert suffix == ".json" or {line["cycle"] for line in lines} == {"short"}
    words = (
        "cycle",
        "on",
        "chosen",
        "gear",
        "open",
        "level",
        "start",
        "end",
        "control",
        "mode",
        "grade",
        "upstream",
        "shared",
    )
    units = ("s", "mps", "mps2", "m", "j", "kg", "w", "nm", "radps", "v", "a")
    assert all(name.rpartition("_")[2] in units + words for name in lines[0])


@pytest.mark.parametrize("suffix", [".csv", ".parquet", ".json"])
def test_rows_and_steps_of_a_comparison_are_one_tidy_table_each(hevopt, suffix):
    rows, steps = Path(f"rows{suffix}"), Path(f"steps{suffix}")
    words = ("compare", "--cycle", "short.csv", "--architectures", "A,C2", "--json")
    status, out, _ = hevopt(*words, "--out", str(rows), "--out-steps", str(steps))
    assert status == 0
    printed, found = json.loads(out)["rows"], read(rows)
    assert [line["strategy"] for line in found] == [row["strategy"] for row in printed]
    for line, row in zip(found, printed, strict=True):
        assert bits(line["fuel_l_per_100km"]) == bits(row["fuel_l_per_100km"])
        assert set(row) <= set(line)
    table = read(steps)
    assert suffix == ".json" or list(table[0])[:3] == ["cycle", "architecture", "strategy"]
    assert len(table) == 9 * len(printed)
    litres = sum(float(s["fuel_kg"]) for s in table if s["strategy"] == "dp") / 0.835
    distance_m = load_cycle("short.csv").distance_m
    dp = next(row for row in printed if row["strategy"] == "dp")
    assert litres / distance_m * 1e5 == pytest.approx(dp["fuel_l_per_100km"], rel=1e-12)


def test_json_and_parquet_name_what_they_come_from(hevopt):
    words = ("run", "C2", "--cycle", "short.csv", "--mass", "1400", "--out")
    for name in ("x.json", "x.parquet"):
        assert hevopt(*words, name)[0] == 0
    from pyarrow import parquet

    packed = json.loads(parquet.read_schema("x.parquet").metadata[b"hevopt"])
    plain = json.loads(Path("x.json").read_text())
    for found in (packed, plain):
        assert found["settings"]["changes"] == {"C2": {"car.mass_kg": 1400.0}}
        assert len(found["inputs"]) == 7 and "hevopt" in found["versions"]
    assert plain["rows"][0]["strategy"] == "dp"


NUMBERS = st.floats(allow_nan=True, allow_infinity=True)


@pytest.mark.parametrize("suffix", outputs.SUFFIXES)
@given(values=st.lists(NUMBERS, min_size=1, max_size=8))
@settings(max_examples=25, deadline=None, derandomize=True)
def test_any_number_is_written_to_its_last_bit_and_what_is_none_is_empty(
    tmp_path_factory, suffix, values
):
    path = tmp_path_factory.getbasetemp() / f"numbers{suffix}"
    comparison = Comparison("c", [Row("A", "dp", OK)])
    steps = pd.DataFrame({"time_s": range(len(values)), "value_w": np.array(values)})
    outputs.write_steps(path, comparison, steps, ABOUT)
    for line, value in zip(read(path), values, strict=True):
        if np.isfinite(value):
            assert bits(line["value_w"]) == bits(value)
        else:
            assert line["value_w"] in ("", None)


def test_rows_of_failed_cases_have_empty_cells(tmp_path):
    rows = [Row("A", "dp", Status(failure="too steep")), Row("A", "ecms", OK, 4.5, engine_starts=3)]
    for suffix in outputs.SUFFIXES:
        path = tmp_path / f"rows{suffix}"
        outputs.write_rows(path, Comparison("c", rows), ABOUT)
        first, second = read(path)
        assert first["fuel_l_per_100km"] in ("", None) and float(second["fuel_l_per_100km"]) == 4.5
        assert first["status"] == "failed: too steep" and int(second["engine_starts"]) == 3


def test_drives_with_different_columns_are_joined_with_gaps():
    first, second = Row("A", "dp", OK), Row("B", "dp", OK)
    driven = pd.DataFrame({"time_s": [0, 1], "x_w": [1.5, 2.5]}), pd.DataFrame({"time_s": [0]})
    table = outputs.joined(list(zip((first, second), driven, strict=True)))
    assert csv_of(table) == b"architecture,strategy,time_s,x_w\nA,dp,0,1.5\nA,dp,1,2.5\nB,dp,0,\n"


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (("--out", "x.xlsx"), "suffix '.xlsx' is unknown; allowed: .csv, .parquet, .json"),
        (("--out", "x"), "a suffix is needed; allowed: .csv, .parquet, .json"),
        (("--out", "no/x.csv"), "No such folder"),
        (("--out", "x.csv", "--out-steps", "./x.csv"), "--out and --out-steps name one file"),
        (("--out", "short.csv"), "--out short.csv is the file that short.csv is read from"),
    ],
)
def test_a_wrong_output_is_one_message_before_anything_is_solved(hevopt, words, said):
    def forbidden(*_, **__):
        pytest.fail("a case was prepared")

    from hevopt.studies import by_car as study

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(study, "prepare", forbidden)
        status, out, err = hevopt("compare", "--cycle", "short.csv", *words)
    assert (status, out) == (2, "") and err.count("hevopt: ") == 1 and said in err
    assert Path("short.csv").read_text() == SHORT


def test_parquet_without_pyarrow_says_what_to_install(monkeypatch, tmp_path):
    monkeypatch.setattr(outputs, "find_spec", lambda name: None)
    with pytest.raises(DataError, match=r"pip install 'hevopt\[parquet\]'"):
        outputs.check_table_file(tmp_path / "x.parquet")
    outputs.check_table_file(tmp_path / "x.CSV")


def test_the_same_run_writes_the_same_bytes(hevopt):
    words = ("run", "C2", "--cycle", "short.csv", "--out")
    for name in ("a.csv", "b.csv"):
        assert hevopt(*words, name)[0] == 0
    assert Path("a.csv").read_bytes() == Path("b.csv").read_bytes()


def test_a_proof_that_was_not_found_is_named_in_json_and_below_the_table(hevopt, monkeypatch):
    from hevopt import SolverError
    from hevopt.bounds import certificate

    def stopped(*_):
        raise SolverError("HiGHS stopped with status 4")

    words = ("run", "C2", "--cycle", "./short.csv")
    assert "lost_proofs" not in json.loads(hevopt(*words, "--json").out)
    monkeypatch.setattr(certificate, "costate_dual", stopped)
    for command in (
        words,
        ("compare", "--architectures", "C2", "--strategies", "dp", "--cycle", "./short.csv"),
    ):
        lost = json.loads(hevopt(*command, "--json").out)["lost_proofs"]
        assert lost == {"C2, costate prices": "HiGHS stopped with status 4"}
    hevopt(*command, "--save", "all.json.gz")
    assert load_results(Path("all.json.gz")).lost_proofs == lost
    assert "proof not found: C2, costate prices: HiGHS stopped" in hevopt(*words).out
