"""Work shared between two processes: the same results, errors and interrupts as by one."""

import multiprocessing
import os
import signal
import subprocess
import sys
import threading
import time
from dataclasses import asdict
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from split_cars import short

from hevopt.driving.cycle import load_cycle
from hevopt.errors import DataError, InfeasibleError
from hevopt.problem.problem import Problem
from hevopt.strategies import chosen
from hevopt.studies.by_car import NOBODY, Solving, Watch
from hevopt.studies.cars import cars_of
from hevopt.studies.comparison import compare_cars, solve
from hevopt.studies.halves import SharedCount, ahead, halves, two_processors
from hevopt.studies.settings import Settings

pytestmark = [
    pytest.mark.skipif(not hasattr(os, "fork"), reason="needs fork"),
    # Workers of the test runner have threads, which from Python 3.12 on is warned of.
    pytest.mark.filterwarnings("ignore:.*fork:DeprecationWarning"),
]


def test_results_come_back_in_order_from_both_processes() -> None:
    def work(n: int) -> tuple[int, int]:
        time.sleep(0.02)
        tally.add(1)
        return n * n, os.getpid()

    tally = SharedCount()
    found = halves(work, range(12), tally)

    assert [square for square, _ in found] == [n * n for n in range(12)]
    assert len({process for _, process in found}) == 2
    assert tally.total() == 12


def test_first_process_does_what_comes_after_while_it_waits() -> None:
    done: list[int] = []
    own, tally = os.getpid(), SharedCount()

    def work(n: int) -> int:
        if os.getpid() != own:
            tally.add(1)
            time.sleep(0.5)
        while not tally.total():
            time.sleep(0.01)
        return os.getpid()

    found = halves(work, range(4), tally, lambda: done.append(os.getpid()))

    assert done == [own] and len(set(found)) == 2


def test_what_another_process_reads_is_as_if_it_were_read_here(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr("hevopt.studies.halves.two_processors", lambda: True)
    car, cycle = ahead(lambda: (cars_of(("C2",), Settings()).cars[0], load_cycle("nedc")))()

    assert not car.battery.soc.flags.writeable and not cycle.speed_mps.flags.writeable
    assert {array.flags.writeable for array in car.battery.arrays[:5]} == {False}


def test_cars_with_more_states_and_strategies_are_solved_first(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    orders: list[list[str]] = []
    monkeypatch.setattr("hevopt.studies.by_car.two_processors", lambda: True)
    monkeypatch.setattr(
        "hevopt.studies.by_car.halves",
        lambda work, order, *_: orders.append([cars[n].name for n in order]) or [],
    )
    cars = cars_of(("A", "B", "C1", "E"), Settings()).cars

    compare_cars(cars, load_cycle("nedc"), Settings(), may_fork=True)

    assert orders == [["E", "C1", "B", "A"]]


def test_first_error_in_order_is_raised_whoever_met_it() -> None:
    def work(n: int) -> int:
        time.sleep(0.02)
        if n in (3, 4):
            raise (DataError if n == 3 else InfeasibleError)(f"fault {n}")
        return n

    for _ in range(3):
        with pytest.raises(DataError, match="fault 3"):
            halves(work, range(8), SharedCount())


def test_what_a_killed_process_does_not_bring_back_is_done_here() -> None:
    own = os.getpid()

    def work(n: int) -> int:
        if os.getpid() != own:
            os.kill(os.getpid(), signal.SIGKILL)
        time.sleep(0.02)
        return n

    assert halves(work, range(6), SharedCount()) == list(range(6))


def test_interrupt_leaves_no_process_behind() -> None:
    own = os.getpid()

    def work(n: int) -> int:
        if os.getpid() == own:
            raise KeyboardInterrupt
        time.sleep(60)
        return n

    with pytest.raises(KeyboardInterrupt):
        halves(work, range(4), SharedCount())
    assert not multiprocessing.active_children()


def test_work_ahead_is_done_by_another_process_until_its_result_is_asked_for() -> None:
    found = ahead(lambda: (os.getpid(), bytes(100_000)))

    time.sleep(0.02)
    other, sent = found()

    assert other != os.getpid() and len(sent) == 100_000
    assert not multiprocessing.active_children()


def test_error_of_work_ahead_is_raised_where_its_result_is_asked_for() -> None:
    def work() -> int:
        raise InfeasibleError("too steep")

    found = ahead(work)

    with pytest.raises(InfeasibleError, match="too steep"):
        found()


def test_work_ahead_that_does_not_come_back_is_done_here() -> None:
    own = os.getpid()

    def killed() -> int:
        if os.getpid() != own:
            os.kill(os.getpid(), signal.SIGKILL)
        return os.getpid()

    def unsound() -> int:
        if os.getpid() != own:
            raise RuntimeError("met by the first process, if at all")
        return os.getpid()

    assert ahead(killed)() == ahead(unsound)() == own


def test_work_ahead_is_left_for_later_where_there_is_no_processor(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    done: list[int] = []
    monkeypatch.setattr("hevopt.studies.halves.two_processors", lambda: False)

    found = ahead(lambda: done.append(os.getpid()))
    before = list(done)
    found()

    assert not before and done == [os.getpid()]


_KILLED = """
import os, signal, sys, time
from hevopt.studies.halves import SharedCount, halves
own = os.getpid()
def work(n):
    if os.getpid() == own:
        time.sleep(0.3)
        os.kill(own, int(sys.argv[1]))
    time.sleep(float(sys.argv[2]))
    return b"more than a pipe holds" * 10_000
halves(work, range(3), SharedCount())
"""


@pytest.mark.parametrize("by", [signal.SIGKILL, signal.SIGTERM])
@pytest.mark.parametrize("busy_s", [0.01, 60], ids=["that sends", "at work"])
def test_process_does_not_outlive_the_first_one(by: signal.Signals, busy_s: float) -> None:
    asked = [sys.executable, "-c", _KILLED, str(int(by)), str(busy_s)]

    # Both hold the pipe: it is at its end when both are gone.
    ended = subprocess.run(asked, stdout=subprocess.PIPE, timeout=30, check=False)

    assert ended.returncode == -by


def test_comparison_by_two_processes_is_that_of_one(monkeypatch: pytest.MonkeyPatch) -> None:
    settings = Settings(strategies=("start_stop", "dp"))
    cars = cars_of(("A", "B", "C1"), settings).cars
    cycle = load_cycle("nedc")
    told: list[tuple[int, int]] = []
    monkeypatch.setattr("hevopt.studies.by_car.two_processors", lambda: True)

    watch = Watch(lambda _, done, total: told.append((done, total)))
    forked = compare_cars(cars, cycle, settings, watch=watch, may_fork=True)
    alone = compare_cars(cars, cycle, settings)

    assert [_untimed(row) for row in forked.rows] == [_untimed(row) for row in alone.rows]
    assert forked.reference == alone.reference
    assert forked.failures.keys() == alone.failures.keys()
    assert all(0 <= done < total for done, total in told)


@pytest.mark.parametrize(
    ("of_first", "missed", "kept"),
    [(True, 1, "/x"), (False, 0, "/x"), (False, 1, "/x"), (False, 1, None)],
)
def test_a_forked_process_that_has_to_compile_begins_with_the_loops_of_strategies(
    of_first: bool, missed: int, kept: str | None, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Where they are kept on the disk: else the other process would not find them."""
    solved: list[str] = []

    def noted(name: str) -> SimpleNamespace:
        return SimpleNamespace(usual=name != "mpc", solve=lambda problem: solved.append(name))

    misses = {"types": 1} if missed else {}
    loop = SimpleNamespace(stats=SimpleNamespace(cache_misses=misses, cache_path=kept))
    monkeypatch.setattr("hevopt.studies.by_car.resolved", loop)
    monkeypatch.setattr("hevopt.studies.by_car.strategy_named", noted)
    case: Any = None
    solving = Solving([], load_cycle("nedc"), Settings(), {}, NOBODY)
    solving.tally.of_first = of_first
    for _ in range(2):
        solving._compile(("ecms", "dp", "mpc", "conventional"), case)
    assert solved == (["ecms", "conventional"] if missed and kept and not of_first else [])


def test_strategies_from_outside_are_asked_by_one_process(monkeypatch: pytest.MonkeyPatch) -> None:
    """One may remember from car to car, and would depend on who took which."""
    asked: list[int] = []

    def counting(problem: Problem) -> NDArray[np.int64]:
        asked.append(os.getpid())
        return solve(problem, "start_stop").control

    names, others = chosen({"counting": counting})
    settings = Settings(strategies=names)
    monkeypatch.setattr("hevopt.studies.by_car.two_processors", lambda: True)

    cars = cars_of(("A", "B", "C1"), settings).cars
    found = compare_cars(cars, short("udds", 60), settings, others=others, may_fork=True)

    assert asked == [os.getpid()] * 3 and all(row.solved for row in found.rows)


def test_a_process_with_threads_is_not_forked() -> None:
    enough = threading.Event()
    thread = threading.Thread(target=enough.wait)
    thread.start()
    try:
        assert not two_processors()
    finally:
        enough.set()
        thread.join()


def _untimed(row: object) -> dict[str, object]:
    return {name: value for name, value in asdict(row).items() if name != "solve_s"}  # type: ignore[call-overload]
