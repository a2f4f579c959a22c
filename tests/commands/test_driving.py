"""`hevopt drive`, as a user runs it."""

import csv
import json

import pytest


def test_a_run_prints_its_twin_the_audit_and_how_it_was_driven(hevopt):
    seen = hevopt("drive", "C2", "--step", "0.05")
    assert seen.status == 0, seen.err
    for word in (
        "forward",
        "backward",
        "bound",
        "road",
        "SAE J2951",
        "by kind of step",
        "everywhere",
    ):
        assert word in seen.out


def test_as_json_the_audit_adds_up(hevopt):
    told = json.loads(hevopt("drive", "D", "--step", "0.05", "--json").out)
    assert abs(sum(told["energy_j"].values())) < 1e-6 * told["energy_j"]["fuel"]
    assert told["marks"] == [] and told["backward"]["architecture"] == "D"
    assert told["quality"]["violations"] == [] and told["handling"]["shifting"]["gap_s"] == 0.5
    assert sum(told["difference_percent"].values()) == pytest.approx(
        told["change_percent"], abs=1e-6
    )


def test_a_missed_trace_is_told_and_status_3_where_asked(hevopt):
    words = ("drive", "A", "--strategy", "baseline", "--cycle", "us06", "--step", "0.05")
    seen = hevopt(*words)
    assert seen.status == 0 and "trace missed" in seen.out and "trace: left ±2 km/h" in seen.out
    assert "km/h outside" in seen.out
    assert hevopt(*words, "--strict").status == 3


def test_steps_are_written_with_units(hevopt, tmp_path):
    seen = hevopt("drive", "A", "--strategy", "baseline", "--step", "0.1", "--out", "steps.csv")
    assert seen.status == 0 and "steps written to steps.csv" in seen.out
    with open(tmp_path / "steps.csv") as file:
        rows = list(csv.DictReader(file))
    assert len(rows) == 11800
    assert {"time_s", "speed_end_mps", "gear", "engine", "clutch_loss_w", "tyre_lag_w"} <= set(
        rows[0]
    )


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (["A", "--step", "1"], "step 1 s; allowed: 0.001 to 0.1 s"),
        (["A", "--strategy", "fastest"], "fastest"),
        (["A", "--strategy", "baseline", "--out", "steps.txt"], "suffix '.txt' is unknown"),
    ],
)
def test_bad_input_is_one_message(hevopt, words, message):
    seen = hevopt("drive", *words)
    assert seen.status in (2, 3) and message in seen.err and seen.err.count("\n") == 1, seen.err


def test_performance_prints_times_and_draws_the_forces(hevopt, tmp_path):
    seen = hevopt("performance", "A,C2", "--boost", "--plot", "forces.svg")
    assert seen.status == 0, seen.err
    for word in ("from rest", "in gear", "top speed and slope", "C2, e-boost", "steady map",
                 "in gear, kJ from the battery", "A: e_boost is none of its functions"):  # fmt: skip
        assert word in seen.out
    assert "C2: e_boost" not in seen.out
    drawn = (tmp_path / "forces.svg").read_text()
    assert drawn.startswith("<?xml") and "nan" not in drawn
    told = json.loads(hevopt("performance", "C2", "--boost", "--json").out)
    alone, boosted = told["cars"]
    assert boosted["to_speed_s"]["100"] < alone["to_speed_s"]["100"]
    assert alone["repeats_until_empty"] is None


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (["A", "--added-mass", "9999"], "allowed: -200 to 5000 kg"),
        (["A", "--gap", "-1"], "gap_s -1; allowed: 0 to 5"),
        (["p2_petrol_dct", "--engine-model", "mean_value"], "has no [mean_value] part"),
        (["A", "--plot", "forces.txt"], "ends in .png, .svg or .pdf"),
        ([","], "no cars"),
    ],
)
def test_bad_input_of_performance_is_one_message(hevopt, words, message):
    seen = hevopt("performance", *words)
    assert seen.status == 2 and message in seen.err and seen.err.count("\n") == 1, seen.err


def test_a_strategy_decides_on_the_way_or_is_replayed_as_asked(hevopt, tmp_path):
    from hevopt.driving.cycle import load_cycle

    whole = load_cycle("nedc")
    lines = [f"{t:g},{v:.6f}" for t, v in zip(whole.time_s[:80], whole.speed_mps[:80], strict=True)]
    cycle = tmp_path / "part.csv"
    cycle.write_text("\n".join(["time_s,speed_mps", *lines]) + "\n")
    words = ("drive", "C2", "--strategy", "a_ecms", "--cycle", str(cycle), "--step", "0.1")
    assert "decided on the way, every 0.5 s" in hevopt(*words).out
    assert "its plan for the cycle was replayed" in hevopt(*words, "--replay").out
    refused = hevopt(*words, "--decide-every", "0")
    assert refused.status == 2 and "allowed: 0.02 to 10 s" in refused.err
