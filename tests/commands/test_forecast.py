"""What a long drive will take is said beforehand, from what pieces of it took."""

from pathlib import Path

import numpy as np
import pytest

from hevopt.commands import forecast
from hevopt.driving.cycle import Cycle
from hevopt.errors import InfeasibleError


def drive(steps: int) -> Cycle:
    """A drive that stands still but for a stretch behind its middle."""
    time_s = np.arange(steps + 1.0)
    speed = np.where((time_s > 0.6 * steps) & (time_s < 0.7 * steps), 20.0, 0.0)
    return Cycle("long", time_s, speed, np.zeros(steps + 1))


def said(steps, monkeypatch, capsys, *, all_s, step_s):
    """What is printed where every drive takes all_s seconds, and every step of it step_s more."""
    now = [0.0]
    monkeypatch.setattr(forecast, "perf_counter", lambda: now[0])

    def solve(piece):
        now[0] += all_s + step_s * (len(piece.time_s) - 1)

    forecast.say_how_long(drive(steps), solve)
    printed = capsys.readouterr()
    assert not printed.out
    return printed.err


def test_what_a_drive_takes_is_told_apart_from_what_a_step_takes(monkeypatch, capsys):
    line = said(36_000, monkeypatch, capsys, all_s=5.0, step_s=2e-3)
    assert line == "hevopt: 36000 steps will take about 80 s, as 2000 of them take 9.0 s\n"
    assert "about 10 min," in said(200_000, monkeypatch, capsys, all_s=0.0, step_s=3e-3)
    assert "about 2.8 h," in said(200_000, monkeypatch, capsys, all_s=0.0, step_s=5e-2)


@pytest.mark.parametrize("steps, step_s", [(19_999, 10.0), (36_000, 8e-4)])
def test_nothing_is_said_of_short_drives_and_quick_ones(steps, step_s, monkeypatch, capsys):
    assert said(steps, monkeypatch, capsys, all_s=0.0, step_s=step_s) == ""


def test_a_short_piece_that_takes_longer_than_a_long_one_is_left_out_of_account(
    monkeypatch, capsys
):
    line = said(100_000, monkeypatch, capsys, all_s=5.0, step_s=-1e-3)
    assert line == "hevopt: 100000 steps will take about 2 min, as 2000 of them take 3.0 s\n"


def test_a_piece_that_cannot_be_solved_says_nothing(capsys):
    def solve(piece):
        raise InfeasibleError("no feasible control at step 3")

    forecast.say_how_long(drive(20_000), solve)
    assert capsys.readouterr().err == ""


def test_the_piece_is_one_that_is_driven():
    piece = forecast.piece_of(drive(20_000), 1000)
    assert len(piece.time_s) == 1001
    assert piece.distance_m > 19_900


def test_pieces_of_a_comparison_are_driven_forward_where_it_is(hevopt, monkeypatch):
    from hevopt.studies import comparison

    asked = []
    monkeypatch.setattr(forecast, "say_how_long", lambda trace, solve: solve(trace))

    def compare_cars(cars, trace, **how):
        asked.append(how["forward"])
        raise InfeasibleError("seen enough")

    monkeypatch.setattr(comparison, "compare_cars", compare_cars)
    for words in (("--forward",), ()):
        assert hevopt("compare", "--architectures", "A", *words).status == 3
    assert asked == [True, False]


@pytest.mark.parametrize("command", ["pareto", "sensitivity"])
def test_studies_of_long_drives_say_it_too(command, hevopt, monkeypatch):
    """Told by a drive that counts as long, and pieces that are short enough for a test."""
    for name, steps in (("_LONG_STEPS", 60), ("_SHORT_PIECE", 20), ("_LONG_PIECE", 40)):
        monkeypatch.setattr(forecast, name, steps)
    monkeypatch.setattr(forecast, "_WORTH_SAYING_S", 0.0)
    speeds = [min(2 * n, 40, 2 * (80 - n)) for n in range(81)]
    rows = "".join(f"{n},{v}\n" for n, v in enumerate(speeds))
    Path("short.csv").write_text("time_s,speed_kmh\n" + rows)
    words = ("C2", "--points", "2") if command == "pareto" else ("A", "--strategies", "baseline")
    seen = hevopt(command, *words, "--cycle", "short.csv")
    assert seen.status == 0
    assert "hevopt: 80 steps will take about" in seen.err
