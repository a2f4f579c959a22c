"""Steady states: a march towards it, then Newton's method on all rates at once.

Where it rests knows neither the heat capacity of the exhaust's wall nor the rotor's inertia: on the way there the
wall is thin and the rotor of a usual weight.
"""

import numpy as np
from numpy.typing import NDArray

from hevopt.errors import SolverError
from hevopt.mean_value import states as s
from hevopt.mean_value._gas_kernels import coefficients
from hevopt.mean_value._run_kernels import TABLEAUX, jacobian, march, rates
from hevopt.mean_value.parameters import Drive, Model
from hevopt.mean_value.rotor import scaled_inertia_kgm2
from hevopt.mean_value.stability import eigenvalues, longest_step_s, scales

Array = NDArray[np.float64]

# Rates of a steady state, relative to the states' scales.
SETTLED_PS = 1e-10
_STEP_S = 0.25e-3
_MARCH_S, _MARCHES, _NEWTON_STEPS = 4.0, 30, 12
# Growth of a swing that counts as none.
_GROWTH_PS = 0.05
# Steps of all marches together: a file whose volumes are tiny would march for minutes.
_STEPS_MAX = 2_000_000
_THIN_WALL_JPK = 30.0
_LARGEST_CHANGE = 0.3
# Temperatures from which a march begins, by volume, and of the wall.
_START_K = (298.0, 310.0, 310.0, 600.0, 550.0)
_START_WALL_K = 500.0
_START_BURNT = (0.0, 0.0, 0.0, 0.4, 0.4)
_START_TURBO_RADPS = 5000.0


def held(model: Model, seek_nm: float = np.nan) -> Model:
    """The same on a dynamometer: speeds kept, the pedal as it is or moving until the engine gives a torque."""
    return model._replace(drive=Drive(held=1.0, seek_nm=seek_nm))


def steady_state(
    model: Model, engine_radps: float, road_mps: float = 0.0, pedal: float = 1.0
) -> Array:
    """(state,) where the model rests at held speeds, its pedal given or sought; SolverError where it does nowhere.

    What the balances count is 0.
    """
    y = _beginning(model, engine_radps, road_mps, pedal)
    engine = model.engine
    quick = engine._replace(
        wall=engine.wall._replace(capacity_jpk=_THIN_WALL_JPK),
        rotor=engine.rotor._replace(
            inertia_kgm2=scaled_inertia_kgm2(engine.compressor.wheel_diameter_m)[0]
        ),
    )
    thin = model._replace(engine=quick)
    free = [*range(s.PEDAL), *([] if np.isnan(model.drive.seek_nm) else [s.PEDAL])]
    steps = marched = 0
    while marched < _MARCHES and steps < _STEPS_MAX:
        y, taken = _marched(thin, y)
        marched, steps = marched + 1, steps + taken
        found = _newton(thin, y, free)
        if found is not None:
            found[s.DYNAMIC :] = 0.0
            _check_stable(held(model), found)
            return found
    if steps >= _STEPS_MAX:
        step_us = 1e6 * longest_step_s(0.0, y, thin)
        raise SolverError(
            f"the engine does not settle at {engine_radps * 30 / np.pi:.0f} rpm: its gas path asks for steps of "
            f"{step_us:.2g} µs; check units and size of volumes, pressure losses and areas of its file"
        )
    raise SolverError(
        f"the engine does not settle at {engine_radps * 30 / np.pi:.0f} rpm: after {_MARCH_S * marched:g} s its "
        "rates still change; check the control unit's gains, vanes and smoke limit"
    )


def _check_stable(model: Model, y: Array) -> None:
    """SolverError where the model swings about a steady state instead of resting there."""
    growth = float(eigenvalues(0.0, y, model).real.max())
    if growth > _GROWTH_PS:
        raise SolverError(
            f"the engine does not settle at {y[s.ENGINE] * 30 / np.pi:.0f} rpm: it swings about its steady state, "
            f"growing by e in {1 / growth:.2g} s; lower the control unit's gains or lags"
        )


def _beginning(model: Model, engine_radps: float, road_mps: float, pedal: float) -> Array:
    y = np.zeros(s.SIZE)
    gas = model.gas
    for n, (volume, kelvin, burnt) in enumerate(
        zip(model.engine.volumes, _START_K, _START_BURNT, strict=True)
    ):
        a, b = coefficients(burnt, gas)
        mass = model.ambient.pressure_pa * volume / (gas.constant_jpkgk * kelvin)
        y[3 * n : 3 * n + 2] = mass, mass * burnt
        y[3 * n + 2] = mass * kelvin * (a - gas.constant_jpkgk + 0.5 * b * kelvin)
    y[s.TURBO], y[s.WALL] = _START_TURBO_RADPS, _START_WALL_K
    y[s.VANES], y[s.PEDAL] = model.control.vanes_least, pedal
    y[s.ENGINE], y[s.ROAD] = engine_radps, road_mps
    return y


def _marched(model: Model, y: Array) -> tuple[Array, int]:
    """The state some seconds later, and how many steps that took."""
    step = _STEP_S
    while step > longest_step_s(0.0, y, model) and step > 1e-6:
        step /= 2
    steps = round(_MARCH_S / step)
    y = march(0.0, y, step, 1, steps, *TABLEAUX[4], model)[-1]
    if not np.isfinite(y).all():
        raise SolverError(
            "the engine's gas path does not settle: a volume ran empty or overflowed; check volumes, areas and "
            "pressure losses of its file"
        )
    return y, steps


def _newton(model: Model, y: Array, free: list[int]) -> Array | None:
    """The steady state near y; None where no Newton step leads closer."""
    y, scale = y.copy(), scales(y)[free]
    for _ in range(_NEWTON_STEPS):
        found = rates(0.0, y, model)[free] / scale
        if np.abs(found).max() < SETTLED_PS:
            return y
        slopes = jacobian(0.0, y, scales(y), model)[np.ix_(free, free)] * scale / scale[:, None]
        # A saturated integral has neither a rate nor an effect: least squares leave it as it is.
        step = np.linalg.lstsq(slopes, -found, rcond=1e-12)[0]
        if not np.isfinite(step).all() or np.abs(step).max() > _LARGEST_CHANGE:
            return None
        y[free] += step * scale
    return None
