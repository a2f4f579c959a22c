"""Compiled integration with a fixed step: classic Runge-Kutta of fourth order; Heun's and Euler's to compare."""

import numpy as np
from numpy.typing import NDArray

from hevopt._compile import compiled
from hevopt.mean_value import states as s
from hevopt.mean_value._model_kernels import acceleration, derivative, flows
from hevopt.mean_value.parameters import Model

Vector = NDArray[np.float64]
Matrix = NDArray[np.float64]


# Order -> where the stages lie, each reached by the slope before it, and their weights.
TABLEAUX = {
    1: (np.array([0.0]), np.array([1.0])),
    2: (np.array([0.0, 1.0]), np.array([0.5, 0.5])),
    4: (np.array([0.0, 0.5, 0.5, 1.0]), np.array([1.0, 2.0, 2.0, 1.0]) / 6.0),
}


@compiled(nogil=True)
def march(
    t: float,
    y: Vector,
    h: float,
    samples: int,
    steps: int,
    stages: Vector,
    weights: Vector,
    model: Model,
) -> Matrix:
    """(samples + 1, state) states at t and after every `steps` steps of h; stages and weights as in TABLEAUX."""
    found = np.empty((samples + 1, s.SIZE))
    between, slope, next_y = np.empty(s.SIZE), np.zeros(s.SIZE), np.empty(s.SIZE)
    for i in range(s.SIZE):
        found[0, i] = next_y[i] = y[i]
    state = np.empty(s.SIZE)
    for n in range(samples * steps):
        for i in range(s.SIZE):
            state[i] = next_y[i]
        for stage in range(len(stages)):
            at = h * stages[stage]
            for i in range(s.SIZE):
                between[i] = state[i] + at * slope[i]
            derivative(t + n * h + at, between, model, slope)
            for i in range(s.SIZE):
                next_y[i] += h * weights[stage] * slope[i]
        if (n + 1) % steps == 0:
            for i in range(s.SIZE):
                found[(n + 1) // steps, i] = next_y[i]
    return found


@compiled()
def rates(t: float, y: Vector, model: Model) -> Vector:
    """Rates of all states."""
    dy = np.empty(s.SIZE)
    derivative(t, y, model, dy)
    return dy


@compiled()
def jacobian(t: float, y: Vector, scale: Vector, model: Model) -> Matrix:
    """(state, state) derivatives of the rates of the dynamic states by central differences of 1e-6 of a scale."""
    found = np.empty((s.DYNAMIC, s.DYNAMIC))
    slope, moved = np.empty(s.SIZE), np.empty(s.SIZE)
    for i in range(s.SIZE):
        moved[i] = y[i]
    for j in range(s.DYNAMIC):
        width = 1e-6 * scale[j]
        for side in range(2):
            sign = 1.0 - 2.0 * side
            moved[j] = y[j] + sign * width
            derivative(t, moved, model, slope)
            for i in range(s.DYNAMIC):
                before = 0.0 if side == 0 else found[i, j]
                found[i, j] = before + sign * slope[i] / (2.0 * width)
        moved[j] = y[j]
    return found


@compiled(nogil=True)
def observe(times: Vector, states: Matrix, model: Model) -> Matrix:
    """(sample, signal) what the states at some times mean, in the order of states.SIGNALS."""
    found = np.empty((len(times), s.SIGNAL_COUNT))
    for n in range(len(times)):
        y = states[n]
        f = flows(times[n], y, model)
        compression, expansion, burning, asked = f.compression, f.expansion, f.combustion, f.command
        values = (
            acceleration(y, model.car), f.pedal, f.brake, asked.full_load, f.clutch, f.assist,
            f.one.pressure, f.two.pressure, f.three.pressure, f.four.pressure, f.five.pressure,
            f.two.temperature, f.three.temperature, f.four.temperature, f.five.temperature,
            f.three.burnt, asked.target, burning.excess_air, asked.demanded, asked.allowed,
            f.filter, f.egr, burning.flow, burning.fuel, asked.vanes, asked.egr,
            compression.flow, compression.phi, compression.surge, compression.choke, compression.head,
            compression.torque * y[s.TURBO], expansion.torque * y[s.TURBO], expansion.efficiency,
            f.one.temperature,
        )  # fmt: skip
        for i in range(s.SIGNAL_COUNT):
            found[n, i] = values[i]
    return found
