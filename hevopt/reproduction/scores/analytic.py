"""Problems whose optimum is known on paper: what a solver and a bound must come to, whatever is tabulated."""

from typing import NamedTuple

import numpy as np

from hevopt.problem.battery import Battery
from hevopt.problem.problem import Problem
from hevopt.problem.table import ControlTable

STEPS = 120
LEVELS = (21, 101, 1001)
_KG_PER_J = 6e-8


class Paper(NamedTuple):
    """A problem with its optimum by hand. law: the argument, in words"""

    name: str
    levels: int
    problem: Problem
    best_kg: float
    law: str


def even_load(levels: int, *, known: bool = True) -> Paper:
    """A smooth engine and a battery without losses: the engine gives the mean of what is asked, all the time.

    Fuel a P + b P² is convex and the battery's energy linear, so by Jensen's inequality the mean power is best.
    known: the table says that fuel is convex in battery power
    """
    asked_w = 8e3 + 5e3 * np.sin(np.arange(STEPS) * 2 * np.pi / 40)
    engine_w = np.linspace(0.0, 21e3, levels)
    rate = _KG_PER_J * (engine_w + engine_w**2 / 30e3)
    fuel_kg = np.tile(rate, (STEPS, 1))
    table = ControlTable.from_arrays(
        fuel_kg, asked_w[:, None] - engine_w, between="convex" if known else ""
    )
    mean_w = float(asked_w.mean())
    best_kg = STEPS * _KG_PER_J * (mean_w + mean_w**2 / 30e3)
    law = "fuel is convex in power, the battery has no losses: the mean power, in every second"
    return Paper("even load", levels, Problem(table, _lossless(), 0.5, 0.5), best_kg, law)


def on_off(levels: int) -> Paper:
    """A straight engine that idles dearly and stops: full power for as long as it takes, in one go.

    Every joule costs as much at every power, every second of turning an idle and every start a start: the fewest
    seconds at most power, 40 of 120 here, after one start.
    """
    idle_kgps, start_kg, most_w, asked_w = 2e-4, 1e-3, 18e3, 6e3
    engine_w = np.linspace(0.0, most_w, levels)
    running = idle_kgps + _KG_PER_J * engine_w
    fuel_kg = np.tile(np.concatenate([[0.0], running]), (STEPS, 1))
    power_w = np.tile(asked_w - np.concatenate([[0.0], engine_w]), (STEPS, 1))
    table = ControlTable.from_arrays(
        fuel_kg,
        power_w,
        mode=np.array([0] + [1] * levels),
        switch_fuel_kg=np.array([[0.0, start_kg], [0.0, 0.0]]),
        between="linear",
    )
    seconds = STEPS * asked_w / most_w
    best_kg = seconds * (idle_kgps + _KG_PER_J * most_w) + start_kg
    law = "a joule costs as much at every power, turning costs by the second: full power, one start"
    return Paper("on and off", levels, Problem(table, _lossless(), 0.5, 0.5), best_kg, law)


def _lossless() -> Battery:
    nothing = np.zeros(2)
    return Battery(np.array([0.0, 1.0]), np.full(2, 300.0), nothing, nothing, 7200.0, 1.0, 0.1, 0.9)
