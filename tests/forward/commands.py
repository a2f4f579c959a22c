"""What a driven trace asked of its car, step by step, as commands."""

from functools import cache

import numpy as np

from hevopt import build_problem, load_architecture
from hevopt.car.handling import DriverGains, Handling
from hevopt.driving.cycle import Cycle
from hevopt.forward import _drive_kernels as col
from hevopt.forward import _motor_kernels as motor
from hevopt.forward.commanded import Commands
from hevopt.forward.lines import line_of
from hevopt.forward.plans import replay_of
from hevopt.forward.run import follow, loop_car, steps_of, task_of, whole_handling
from hevopt.problem.simulation import simulate
from hevopt.strategies import STRATEGIES

# Nothing is added to the plan's torques on the way.
OPEN_LOOP = Handling(driver=DriverGains(charge_per_s=0.0))


def hill():
    """Away, on a slope, and back to rest, twice; with gears by the car's own speeds."""
    time_s = np.arange(61.0)
    speed = np.interp(
        time_s, [0, 3, 16, 24, 32, 36, 44, 50, 57, 60], [0, 0, 15, 15, 0, 0, 9, 9, 0, 0]
    )
    return Cycle("hill", time_s, speed, np.where(time_s < 20, 0.03, -0.01))


@cache
def asked_on_the_hill(name, step_s):
    """(run, record, commands of every step) of a car on the hill."""
    car, cycle = load_architecture(name), hill()
    problem = build_problem(car, cycle, allow_shortfall=True)
    control = STRATEGIES["dp"].solve(problem).control
    line = line_of(car)
    plan = replay_of(simulate(problem, control), line)
    run = follow(car, cycle, plan, step_s=step_s, handling=OPEN_LOOP)
    whole = whole_handling(car, OPEN_LOOP)
    exact_s, record = steps_of(cycle, step_s, whole)
    task = task_of(car, cycle, plan, cycle.time_s)
    driven = loop_car(car, line, whole, task.load_w)
    loop = col.begun(driven, task, float(plan.energy_j[0]))
    col.advance(driven, task, col.work_of(driven.ways), loop, 0, record, exact_s)
    at = np.searchsorted(cycle.time_s, run.time_s[:-1] + 1e-9, "right") - 1
    holds_n = -3.0 * car.vehicle.mass_kg
    commands = []
    for row, k in zip(record, at.tolist(), strict=True):
        force, way = float(row[col.ASKED]), int(plan.way[k])
        opened = plan.open_while[k] == 2 or (plan.open_while[k] == 1 and force < 0)
        turns = row[col.PHASE] in (motor.STARTING, motor.TURNING)
        commands.append(
            Commands(force, force == holds_n, *line.keys[way][:2], bool(turns), bool(opened),
                     float(plan.machine_nm[k]), float(cycle.grade[k]))
        )  # fmt: skip
    return run, record, commands
