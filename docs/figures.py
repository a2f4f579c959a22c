"""Figures of the theory pages, drawn from the shipped cars: python docs/figures.py, or by mkdocs as it builds.

Each is computed afresh, so that a page never shows what the code no longer does.
"""

from collections.abc import Callable
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure

from hevopt import build_problem, compare, load_architecture, load_cycle, simulate, solve
from hevopt.bounds._prices_kernels import shortest_path
from hevopt.bounds.bounded import drain_at_j
from hevopt.bounds.lower_dp import lower_bound_kg
from hevopt.bounds.prices import one_price_dual
from hevopt.bounds.step_prices import costate_dual, lp_prices_kgpj
from hevopt.problem.choices import choices_of
from hevopt.problem.problem import Problem
from hevopt.problem.table import ControlTable

FOLDER = Path(__file__).parent / "figures"
_INK, _BLUE, _RED, _GREY = "#24292f", "#1f6feb", "#c93c37", "#8b949e"


def _problem(**changes: object) -> Problem:
    """C2 on the NEDC; a key's dots are written as two underscores."""
    settings = {key.replace("__", "."): value for key, value in changes.items()}
    return build_problem(load_architecture("C2", settings), load_cycle("nedc"))


def _rest_of(problem: Problem, step: int, soc: float, mode: int) -> Problem:
    """What is left of a problem from a step on."""
    table = problem.table

    def later(matrix: np.ndarray) -> np.ndarray:
        return matrix if matrix.ndim == 2 else matrix[step:]

    kept = ControlTable.from_arrays(
        table.fuel_kg[step:], table.battery_power_w[step:], table.feasible[step:], step_s=table.step_s[step:],
        mode=table.mode, switch_fuel_kg=later(table.switch_fuel_kg),
        switch_allowed=later(table.switch_allowed), switch_energy_j=later(table.switch_energy_j),
    )  # fmt: skip
    return Problem(kept, problem.battery, soc, problem.soc_end_min, start_mode=mode)


def _axes(width: float = 7.0, height: float = 3.2, rows: int = 1) -> tuple[Figure, list]:
    figure = Figure(figsize=(width, height), layout="constrained")
    axes = list(np.atleast_1d(figure.subplots(rows, 1, sharex=rows > 1)))
    for each in axes:
        each.spines[["top", "right"]].set_visible(False)
    return figure, axes


def dual() -> Figure:
    """The one-multiplier dual over its price, with its supporting lines."""
    problem = _problem()
    lines = one_price_dual(problem)
    plan_kg = simulate(problem, solve(problem).control).cost_kg
    top = lines[-1]
    price = np.linspace(0.5, 1.5, 200) * top.scale
    height = np.array([line.value_kg + line.slope_kg * (price - line.scale) for line in lines])
    figure, (axes,) = _axes()
    for each in height:
        axes.plot(price * 3.6e9, each * 1e3, color=_GREY, lw=0.6)
    axes.plot(
        price * 3.6e9,
        height.min(axis=0) * 1e3,
        color=_BLUE,
        lw=2,
        label="dual g(λ), least of the lines",
    )
    axes.axhline(plan_kg * 1e3, color=_RED, label="plan of dp")
    axes.plot(top.scale * 3.6e9, top.value_kg * 1e3, "o", color=_BLUE, label="best bound")
    axes.set_ylim(0.97 * top.value_kg * 1e3, 1.01 * plan_kg * 1e3)
    axes.set(xlabel="price λ of stored energy, g/kWh", ylabel="fuel, g")
    axes.legend(frameon=False, loc="lower left")
    return figure


def prices() -> Figure:
    """Prices over time where the window binds, and the charge beside them."""
    problem = _problem(battery__capacity_ah=2.0)
    rollout = simulate(problem, solve(problem).control)
    time = problem.table.time_s
    figure, (upper, lower) = _axes(height=4.4, rows=2)
    flat = costate_dual(problem, rollout)[-1].price_kgpj
    upper.axhline(flat * 3.6e9, color=_GREY, label="best costate price, nearly constant")
    upper.step(
        time, lp_prices_kgpj(problem, rollout) * 3.6e9, where="post", color=_BLUE, label="LP prices"
    )
    upper.set(ylabel="price, g/kWh", ylim=(0, None))
    upper.legend(frameon=False)
    lower.plot(np.append(time, time[-1] + problem.table.step_s[-1]), rollout.soc, color=_INK)
    for edge in (problem.battery.soc_min, problem.battery.soc_max):
        lower.axhline(edge, color=_RED, lw=0.8, ls="--")
    lower.set(xlabel="time, s", ylabel="SOC")
    return figure


def value() -> Figure:
    """Least fuel still to burn over stored energy, at three times of the cycle."""
    problem = _problem()
    trajectory = simulate(problem, solve(problem).control)
    steps = len(problem.table.time_s)
    figure, (axes,) = _axes()
    for k, colour in zip((0, steps // 2, steps - 120), (_INK, _BLUE, _GREY), strict=True):
        mode = problem.start_mode if k == 0 else int(trajectory.mode[k - 1])
        energy, to_go = [], []
        for soc in np.linspace(0.42, 0.78, 13):
            rest = _rest_of(problem, k, soc, mode)
            energy.append(rest.start_j / 3.6e6)
            to_go.append(1e3 * simulate(rest, solve(rest).control).cost_kg)
        axes.plot(energy, to_go, color=colour, label=f"{problem.table.time_s[k]:.0f} s")
        here = trajectory.energy_j[k] / 3.6e6
        axes.plot(here, np.interp(here, energy, to_go), "o", color=colour)
    axes.set(xlabel="stored energy, kWh", ylabel="fuel still to burn, g")
    axes.legend(frameon=False, title="time; dot: dp's plan")
    return figure


def factor() -> Figure:
    """End charge under one equivalence factor, over the factor."""
    problem = _problem()
    choices = choices_of(problem)
    drain_j = drain_at_j(problem, choices, problem.start_j)
    factors = np.linspace(0.97, 1.03, 121) * one_price_dual(problem)[-1].price_kgpj
    gained = []
    for each in factors:
        priced_kg = choices.cost_kg + each * drain_j
        _, path, _ = shortest_path(
            choices, priced_kg, np.full(choices.steps, each), problem.start_mode
        )
        gained.append(-float(drain_j[path].sum()) / 3.6e6)
    figure, (axes,) = _axes()
    axes.plot(factors * 3.6e9, gained, ".-", color=_BLUE, lw=0.8, ms=4)
    axes.axhline(0, color=_RED, lw=0.8, label="charge neutral")
    axes.set(xlabel="equivalence factor, g/kWh", ylabel="energy gained, kWh")
    axes.legend(frameon=False)
    return figure


def lower() -> Figure:
    """Bounds of the lower-bound DP over its grid, between one multiplier and the plan."""
    problem = _problem(engine__start_fuel_g=1.0)
    plan_kg = simulate(problem, solve(problem).control).cost_kg
    best = one_price_dual(problem)[-1]
    nodes = (501, 1001, 2001, 4001, 8001, 16001)
    bounds = [lower_bound_kg(problem, best.price_kgpj, nodes=n) for n in nodes]
    figure, (axes,) = _axes()
    axes.semilogx(nodes, np.array(bounds) * 1e3, "o-", color=_BLUE, label="lower-bound DP")
    axes.axhline(plan_kg * 1e3, color=_RED, label="plan of dp")
    axes.axhline(best.value_kg * 1e3, color=_GREY, ls="--", label="one multiplier")
    axes.set(xlabel="nodes of stored energy", ylabel="fuel, g")
    axes.legend(frameon=False)
    return figure


def drive() -> Figure:
    """The optimum over time."""
    problem = _problem()
    return simulate(problem, solve(problem).control).plot()[0].figure


def rows() -> Figure:
    """A comparison of two cars."""
    axes = compare("hwfet", ["A", "C2"]).plot()
    axes.set_xlim(left=0)
    return axes.figure


def flow() -> Figure:
    """The house: what flows from a cycle and a car to rows and pages."""
    figure = Figure(figsize=(9.0, 2.6))
    axes = figure.add_axes((0, 0, 1, 1))
    axes.set(xlim=(0, 9), ylim=(0, 2.6))
    axes.axis("off")
    boxes = {
        "driving\ncycle, demand": (0.7, 1.9), "car\ncomponents": (0.7, 0.8), "powertrain": (2.3, 1.35),
        "problem\ncontrol table, battery": (4.0, 1.35), "strategies": (5.8, 2.1), "bounds": (5.8, 0.6),
        "simulate": (7.0, 2.1), "studies\nrows": (8.2, 1.35),
    }  # fmt: skip
    drawn = {}
    for text, place in boxes.items():
        waist = text.startswith("problem")
        style = {
            "boxstyle": "round,pad=0.4",
            "fc": "#ddf4ff" if waist else "#f6f8fa",
            "ec": _BLUE if waist else _GREY,
        }
        drawn[text.split("\n")[0]] = axes.text(
            *place, text, ha="center", va="center", fontsize=9, bbox=style, color=_INK, zorder=2
        )
    for start, end in (
        ("driving", "powertrain"), ("car", "powertrain"), ("powertrain", "problem"), ("problem", "strategies"),
        ("problem", "bounds"), ("strategies", "simulate"), ("simulate", "studies"), ("bounds", "studies"),
    ):  # fmt: skip
        boxed = {"patchA": drawn[start].get_bbox_patch(), "patchB": drawn[end].get_bbox_patch()}
        places = drawn[end].get_position(), drawn[start].get_position()
        axes.annotate("", *places, arrowprops={"arrowstyle": "->", "color": _INK, **boxed})
    return figure


FIGURES: dict[str, Callable[[], Figure]] = {
    drawn.__name__: drawn for drawn in (flow, dual, prices, value, factor, lower, drive, rows)
}


def on_pre_build(config: object) -> None:
    """Draw what is missing; mkdocs calls this before it reads the pages."""
    FOLDER.mkdir(exist_ok=True)
    for name, draw in FIGURES.items():
        file = FOLDER / f"{name}.svg"
        if not file.exists():
            draw().savefig(file, metadata={"Date": None})


if __name__ == "__main__":
    for name in FIGURES:
        (FOLDER / f"{name}.svg").unlink(missing_ok=True)
    on_pre_build(None)
