"""The command line as a user sees it."""

import csv
import json
import os
import resource
import subprocess
import sys
from pathlib import Path

import pytest
from command_line import call

from hevopt.studies.rows import Row

KEYS = """architecture, strategy, status, fuel_l_per_100km, delta_fuel_percent, co2_g_per_km, nox_mg_per_km,
delta_nox_percent, soc_start, soc_end, delta_energy_percent, electricity_kwh_per_100km,
fuel_corrected_l_per_100km, engine_starts, bound_l_per_100km, gap_percent, certificate, solve_s"""


def test_json_has_the_promised_keys_in_order(monkeypatch, capsys):
    status, out, _ = call(monkeypatch, capsys, "compare", "--architectures", "A,C2", "--json")
    assert status == 0
    result = json.loads(out)
    assert list(result) == ["cycle", "rows", "causal", "inputs", "versions", "settings"]
    promised = KEYS.replace("\n", " ").replace(" ", "").split(",")
    assert list(Row.__dataclass_fields__) == promised
    assert all(list(row) == promised for row in result["rows"])
    assert [row["strategy"] for row in result["rows"]] == [
        "baseline", "conventional", "nox_cut", "ecms", "dp",
    ]  # fmt: skip


def test_the_table_shows_every_row_and_the_published_figures(monkeypatch, capsys):
    status, out, err = call(monkeypatch, capsys, "compare", "--architectures", "A,B")
    assert status == 0
    assert "start_stop" in out and "published" in out and "-6 %" in out
    assert "Traceback" not in err


def test_run_writes_a_trajectory_whose_columns_add_up_to_the_table(monkeypatch, capsys, tmp_path):
    path = tmp_path / "traj.csv"
    words = ("run", "C2", "--strategy", "conventional", "--out", str(path))
    status, out, _ = call(monkeypatch, capsys, *words)
    assert status == 0 and "calibration" in out
    with path.open() as file:
        rows = list(csv.DictReader(file))
    assert len(rows) == 1180
    litres = sum(float(row["fuel_kg"]) for row in rows) / 0.835 / 11.0282 * 100
    shown = next(line for line in out.splitlines() if "conventional" in line).split()[2]
    assert float(shown) == pytest.approx(litres, abs=6e-4)
    assert max(abs(float(row["residual_whole_car_w"])) for row in rows) < 1e-6
    assert {"soc_start", "soc_end", "battery_power_w", "engine_torque_nm", "clutch_loss_w"} <= set(
        rows[0]
    )


def test_cycles_and_architectures_are_listed(monkeypatch, capsys):
    _, cycles, _ = call(monkeypatch, capsys, "cycles")
    _, cars, _ = call(monkeypatch, capsys, "architectures")
    assert "11.03 km" in cycles and len(cycles.splitlines()) == 9
    names = [line.split()[0] for line in cars.splitlines() if line.startswith("  ")]
    heads = [line.split(":")[0] for line in cars.splitlines() if line and line[0] != " "]
    assert heads[:3] == ["study", "templates", "real"]
    files = (Path(__file__).parents[2] / "architectures").rglob("*.toml")
    assert names[:6] == ["A", "B", "C1", "C2", "D", "E"]
    assert sorted(names) == sorted(path.stem for path in files if path.parent.name != "components")


def test_a_cycle_the_car_cannot_follow_ends_with_3_unless_shortfall_is_allowed(monkeypatch, capsys):
    words = ("compare", "--architectures", "A", "--cycle", "us06")
    status, out, err = call(monkeypatch, capsys, *words)
    assert status == 3 and "Nm missing" in err and "t = 299 s" in err and "failed" in out
    status, out, _ = call(monkeypatch, capsys, *words, "--allow-shortfall")
    assert status == 0 and "shortfall at 1 step" in out


def test_names_and_paths_work_from_any_directory(monkeypatch, capsys, tmp_path):
    (tmp_path / "mine.csv").write_text("time_s,speed_kmh\n0,0\n10,36\n20,36\n30,0\n")
    monkeypatch.chdir(tmp_path)
    for name in ("mine.csv", "./mine.csv", str(tmp_path / "mine.csv"), "nedc"):
        words = ("compare", "--architectures", "A", "--cycle", name)
        assert call(monkeypatch, capsys, *words)[0] == 0


def test_a_nox_weight_lowers_nox_and_keeps_the_bound_below(monkeypatch, capsys):
    words = (
        "compare",
        "--architectures",
        "C2",
        "--strategies",
        "dp,ecms",
        "--json",
        "--nox-weight",
    )
    plain, priced = (
        json.loads(call(monkeypatch, capsys, *words, weight)[1])["rows"] for weight in ("0", "30")
    )
    for before, after in zip(plain, priced, strict=True):
        assert after["nox_mg_per_km"] < 0.9 * before["nox_mg_per_km"]
        assert after["fuel_l_per_100km"] > before["fuel_l_per_100km"]
        assert after["gap_percent"] >= 0


# What `hevopt --help` may load beside the standard library; all that takes long comes with the work itself.
LIGHT = {
    "hevopt", "typer", "click", "rich", "shellingham", "annotated_doc", "typing_extensions", "colorama",
}  # fmt: skip
HELP = """
import sys
before = set(sys.modules)
from hevopt.cli import main
sys.argv = ["hevopt", "--help"]
try:
    main()
finally:
    loaded = {name.split(".")[0] for name in set(sys.modules) - before}
    print(*loaded - sys.stdlib_module_names, file=sys.stderr)
"""


def test_help_loads_nothing_that_takes_long():
    done = subprocess.run([sys.executable, "-c", HELP], capture_output=True, text=True)
    assert done.returncode == 0 and "compare" in done.stdout
    assert "hevopt" in done.stderr.split()
    assert set(done.stderr.split()) <= LIGHT


PARSED = """
import sys
from hevopt import cli
from hevopt.commands import reading
reading.read_ahead = lambda *given: sys.exit(7 + ("pydantic" in sys.modules))
sys.argv = ["hevopt", "compare", *sys.argv[1:]]
cli.main()
"""


def test_a_comparison_without_options_is_read_by_another_process_before_anything_checks_values():
    assert subprocess.run([sys.executable, "-c", PARSED]).returncode == 7


ENDING = """
import atexit, gc, sys
atexit.register(lambda: print("left alone:", gc.get_freeze_count() > 1000))
from hevopt.cli import main
sys.argv = ["hevopt", "--version"]
main()
"""


def test_what_is_left_at_the_end_is_not_searched_for_rubbish():
    """Which takes a sixth of a second after a comparison."""
    done = subprocess.run([sys.executable, "-c", ENDING], capture_output=True, text=True)
    assert done.returncode == 0 and "left alone: True" in done.stdout


def cycles_into(file, **settings):
    """`hevopt cycles` as a process of its own, its standard output the file."""
    command = [sys.executable, "-m", "hevopt.cli", "cycles"]
    return subprocess.run(command, stdout=file, stderr=subprocess.PIPE, text=True, **settings)


def test_a_closed_pipe_is_not_an_error():
    reader, writer = os.pipe()
    os.close(reader)
    done = cycles_into(writer)
    os.close(writer)
    assert (done.returncode, done.stderr) == (0, "")


@pytest.mark.parametrize("closed", [">&-", "2>&-", "<&- >&- 2>&-", "2>&1 | true"])
@pytest.mark.parametrize(("words", "status"), [("cycles", 0), ("--help", 0), ("run nope", 2)])
def test_closed_streams_change_neither_status_nor_what_the_others_get(closed, words, status):
    program = f"{sys.executable} -c 'from hevopt.cli import main; main()'"
    shell = ["bash", "-c", f"set -o pipefail; {program} {words} {closed}"]
    done = subprocess.run(shell, capture_output=True, text=True)
    assert done.returncode == status, done
    assert ("not found" in done.stderr) == (status == 2 and closed == ">&-")
    assert (done.stdout != "") == (status == 0 and closed == "2>&-")
    assert "rror" not in done.stderr.replace("hevopt: error: ", "", 1)


def test_files_are_written_though_nobody_reads_what_is_said(tmp_path):
    program = f"{sys.executable} -c 'from hevopt.cli import main; main()'"
    words = f"run A --cycle nedc --out {tmp_path}/steps.csv"
    shell = ["bash", "-c", f"set -o pipefail; {program} {words} | true"]
    done = subprocess.run(shell, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    assert (tmp_path / "steps.csv").exists()


def test_names_that_are_no_utf8_work_or_are_one_message(hevopt, tmp_path):
    drive, page = (tmp_path / os.fsdecode(name) for name in (b"c\xe9.csv", b"p\xe9.html"))
    drive.write_text("time_s,speed_kmh\n0,0\n10,36\n20,36\n30,0\n")
    saved = page.with_suffix(".json")
    words = ("--cycle", drive, "--report", page, "--save", saved, "--out", page.with_suffix(".csv"))
    done = hevopt("compare", "--architectures", "A", *words)
    assert done.status == 0, done.err
    assert hevopt("report", saved, "--out", page)[::2] == (0, "")
    component = drive.with_suffix(".toml")
    done = hevopt("compare", "--architectures", "C2", "--set", f'engine="{component}"')
    assert done.status == 2 and done.err.count("hevopt: ") == 1


def test_a_full_disk_is_one_message(tmp_path):
    def allow_no_bytes():
        resource.setrlimit(resource.RLIMIT_FSIZE, (0, 0))

    with (tmp_path / "full").open("w") as file:
        done = cycles_into(file, preexec_fn=allow_no_bytes)
    assert done.returncode == 2
    assert done.stderr == "hevopt: error: cannot write to standard output (File too large)\n"


def test_a_terminal_without_greek_letters_shows_the_table(tmp_path):
    (tmp_path / "c.csv").write_text("time_s,speed_kmh\n0,0\n10,36\n20,36\n30,0\n")
    command = [sys.executable, "-m", "hevopt.cli", "run", "A", "--cycle", tmp_path / "c.csv"]
    ascii_only = os.environ | {"PYTHONIOENCODING": "ascii"}
    done = subprocess.run(command, env=ascii_only, capture_output=True, text=True)
    assert done.returncode == 0 and "?SOC" in done.stdout and "rror" not in done.stderr


@pytest.mark.parametrize("words", [("--architectures", "B"), ("--cycle", "us06")])
def test_published_figures_stand_beside_their_own_cycle_and_reference_only(
    monkeypatch, capsys, words
):
    words = ("compare", "--architectures", "A,B", *words, "--allow-shortfall")
    status, out, _ = call(monkeypatch, capsys, *words)
    assert status == 0 and "published" not in out
