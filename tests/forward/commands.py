"""What a driven trace asked of its car, step by step, as commands."""

from functools import cache

import numpy as np

from hevopt import build_problem, load_architecture
from hevopt.car.handling import DriverGains, Handling
from hevopt.driving.cycle import Cycle
from hevopt.forward import _drive_kernels as col
from hevopt.forward import _motor_kernels as motor
from hevopt.forward.commanded import CommandedCar, Commands
from hevopt.forward.lines import line_of
from hevopt.forward.loops import Driving
from hevopt.forward.plans import replay_of
from hevopt.forward.run import follow, loop_car, steps_of, task_of, whole_handling
from hevopt.problem.simulation import simulate
from hevopt.strategies import STRATEGIES

# Nothing is added to the plan's torques on the way.
OPEN_LOOP = Handling(driver=DriverGains(charge_per_s=0.0))


def hill(faster=1.0):
    """Away, on a slope, and back to rest, twice; with gears by the car's own speeds. faster: times as fast."""
    time_s = np.arange(61.0)
    speed = np.interp(
        time_s, [0, 3, 16, 24, 32, 36, 44, 50, 57, 60], [0, 0, 15, 15, 0, 0, 9, 9, 0, 0]
    )
    return Cycle("hill", time_s, faster * speed, np.where(time_s < 20, 0.03, -0.01))


# A lock-up clutch closes at speed.
FASTER = {"series_parallel_1500": 1.9}


@cache
def asked_on_the_hill(name, step_s):
    """(run, record, commands of every step) of a car on the hill."""
    return asked_of(load_architecture(name), hill(FASTER.get(name, 1.0)), step_s)


def asked_of(car, cycle, step_s):
    """(run, record, commands of every step) of a car on a cycle."""
    problem = build_problem(car, cycle, allow_shortfall=True)
    control = STRATEGIES["ecms" if car.driveline.free_engine_speed else "dp"].solve(problem).control
    line = line_of(car)
    plan = replay_of(simulate(problem, control), line)
    run = follow(car, cycle, plan, step_s=step_s, handling=OPEN_LOOP)
    whole = whole_handling(car, OPEN_LOOP)
    exact_s, record = steps_of(cycle, step_s, whole, len(car.machines))
    task = task_of(car, cycle, plan, cycle.time_s)
    driven = loop_car(car, line, whole, task.load_w)
    driving = Driving(car, line, float(cycle.speed_mps[0]), driven, task, plan.course)
    driving.advance(driving.begun(float(plan.energy_j[0])), 0, record, exact_s)
    at = np.searchsorted(cycle.time_s, run.time_s[:-1] + 1e-9, "right") - 1
    obeys = CommandedCar(car).asked_machines
    commands = [
        commands_of(car, cycle, line, plan, row, k, obeys)
        for row, k in zip(record, at.tolist(), strict=True)
    ]
    return run, record, commands


def commands_of(car, cycle, line, plan, row, k, obeys):
    """What was asked in a step of a run, which lies in step k of the cycle."""
    force, way, course = float(row[col.ASKED]), int(plan.way[k]), plan.course
    turns = row[col.PHASE] in (motor.STARTING, motor.TURNING)
    brakes = force < 0 and car.driveline.converter is None
    opened = plan.open_while[k] == 2 or (plan.open_while[k] == 1 and brakes)
    ordered = dict(zip(line.order, (plan.machine_nm[k], *plan.others_nm[k]), strict=True))
    free = {}
    if course is not None:
        opened, ordered = False, course.machine_nm[k]
        free = {"engine_radps": float(course.engine_radps[k]), "engine_nm": float(course.engine_nm[k]),
                "clutch_closed": bool(course.closed[k])}  # fmt: skip
    torques = [
        (name, float(ordered[n]))
        for n, (name, _) in enumerate(car.driveline.machines) if name in obeys
    ]  # fmt: skip
    holds = force == -3.0 * car.vehicle.mass_kg
    return Commands(
        force, holds, *line.keys[way][:2], bool(turns), bool(opened) and not car.electric, tuple(torques),
        float(cycle.grade[k]), bool(plan.open_while[k] == 3), **free,
    )  # fmt: skip
