"""Scaled engines and machines: the laws, on coefficients and on measured maps, and through the files."""

from dataclasses import fields, replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from hevopt import DataError, build_problem, load_architecture, load_cycle
from hevopt.car.engine_laws import EngineMap
from hevopt.car.machine_laws import LossMap

CAR = load_architecture("C2")
SPEEDS, TORQUES = np.linspace(90, 500, 9)[:, None], np.linspace(-20, 280, 13)
FACTORS = st.floats(0.05, 20)
SAMPLES = st.tuples(st.floats(90, 520), st.floats(-25, 280))


def on_a_grid(engine):
    """The engine with its fuel and NOx as a map, one corner of it not measured."""
    fuel, nox = (f(TORQUES, SPEEDS) for f in (engine.fuel_kgps, engine.nox_kgps))
    fuel[-1, -1] = nox[-1, -1] = np.nan
    drag = engine.drag_nm(SPEEDS[:, 0])
    return replace(engine, law=EngineMap(SPEEDS[:, 0], TORQUES, fuel, nox, drag))


def loss_on_a_grid(machine):
    speeds, torques = np.linspace(0, 650, 8), np.linspace(-120, 120, 13)
    losses = machine.loss_w(torques, speeds[:, None])
    losses[-1, -1] = np.nan
    return replace(machine, loss=LossMap(speeds, torques, losses))


ENGINES = [CAR.engine, on_a_grid(CAR.engine)]
MACHINES = [CAR.machines[0], loss_on_a_grid(CAR.machines[0]), load_architecture("B").machines[0]]


def same_bits(first, second):
    """Whether two values, or dataclasses of values, agree to the last bit, NaN with NaN."""
    if hasattr(first, "__dataclass_fields__"):
        names = [f.name for f in fields(first)]
        return all(same_bits(getattr(first, name), getattr(second, name)) for name in names)
    if isinstance(first, np.ndarray):
        return first.tobytes() == second.tobytes()
    return first == second


@pytest.mark.parametrize("engine", ENGINES, ids=["coefficients", "map"])
@given(factor=FACTORS, sample=SAMPLES)
@settings(max_examples=60, deadline=None, derandomize=True)
def test_fuel_nox_drag_and_full_load_grow_with_displacement_at_equal_speed(engine, factor, sample):
    speed, torque = map(np.array, sample)
    scaled = engine.scaled(factor)
    for flow in ("fuel_kgps", "nox_kgps"):
        before = getattr(engine, flow)(torque, speed)
        after = getattr(scaled, flow)(factor * torque, speed)
        # Where the drag torque is met a fuel cut may fall on either side of rounding.
        near_cut = abs(torque - engine.drag_nm(speed)) < 1e-6
        assert near_cut or np.isclose(after, factor * before, rtol=1e-9, atol=1e-15, equal_nan=True)
    for curve in ("drag_nm", "full_load_nm"):
        assert getattr(scaled, curve)(speed) == pytest.approx(
            factor * getattr(engine, curve)(speed), rel=1e-12, nan_ok=True
        )


@pytest.mark.parametrize("machine", MACHINES, ids=["loss", "map", "efficiency"])
@given(factor=FACTORS, sample=st.tuples(st.floats(1, 640), st.floats(-119, 119)))
@settings(max_examples=60, deadline=None, derandomize=True)
def test_a_machines_loss_and_limits_grow_with_its_torque_at_equal_speed(machine, factor, sample):
    speed, torque = map(np.array, sample)
    scaled = machine.scaled(factor)
    before, after = machine.loss_w(torque, speed), scaled.loss_w(factor * torque, speed)
    assert np.isclose(after, factor * before, rtol=1e-9, equal_nan=True)
    limit = machine.limit_nm(speed)
    assert scaled.limit_nm(speed) == pytest.approx(factor * limit, rel=1e-12)
    generating = machine.generating_nm(250.0, speed)
    wanted = scaled.generating_nm(factor * 250.0, speed)
    assert np.isclose(wanted, factor * generating, rtol=1e-7, equal_nan=True)


@pytest.mark.parametrize("engine", ENGINES, ids=["coefficients", "map"])
def test_an_engine_scaled_by_1_is_the_same_to_the_last_bit(engine):
    assert same_bits(engine.scaled(1.0), engine)
    assert not same_bits(engine.scaled(1.0 + 2**-52), engine)


@pytest.mark.parametrize("machine", MACHINES, ids=["loss", "map", "efficiency"])
def test_a_machine_scaled_by_1_is_the_same_to_the_last_bit(machine):
    assert same_bits(machine.scaled(1.0), machine)


def test_the_whole_table_is_the_same_to_the_last_bit_with_scales_of_1():
    cycle = load_cycle("hwfet")
    ones = {"engine.scale.displacement": 1.0, "machine.scale": {"power": 1}}
    plain, scaled = (build_problem(load_architecture("C2", c), cycle).table for c in ({}, ones))
    for name in ("fuel_kg", "nox_kg", "battery_power_w", "reject"):
        assert getattr(plain, name).tobytes() == getattr(scaled, name).tobytes()


def test_scale_is_a_key_of_the_file_of_the_table_in_an_architecture_and_a_path(tmp_path):
    text = (CAR.source).read_text()
    for name, scale in (("torque", 1.5), ("power", 1.5), ("displacement", 1.5)):
        table = f'engine = {{ file = "engine_diesel_1600", scale = {{ {name} = {scale} }} }}'
        (tmp_path / "mine.toml").write_text(text.replace('engine = "engine_diesel_1600"', table))
        car = load_architecture(tmp_path / "mine.toml")
        assert same_bits(car.engine, load_architecture("C2", {f"engine.scale.{name}": 1.5}).engine)
        assert car.engine.law.displacement_m3 == pytest.approx(1.5 * 1598e-6)
        assert car.engine.inertia_kgm2 == pytest.approx(0.27)
        assert car.engine.law.stroke_m == CAR.engine.law.stroke_m
    machine = load_architecture("C2", {"machine.scale.power": 0.5}).machines[0]
    assert (machine.power_max_w, machine.torque_max_nm) == (9000.0, 60.0)
    assert machine.speed_max_radps == CAR.machines[0].speed_max_radps
    assert machine.loss.c3 == pytest.approx(2 * 0.194)


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"engine.scale": {"torque": 1.1, "power": 1.1}}, "exactly one of torque, power, disp"),
        ({"engine.scale": {}}, "found: none"),
        ({"engine.scale": 1.25}, "a table [scale] is needed"),
        ({"machine.scale.power": 0.0}, "scale.power = 0.0; allowed: 0.05 to 20"),
        ({"machine.scale.displacement": 2.0}, "unknown key scale.displacement"),
    ],
)
def test_a_wrong_scale_is_one_message(changes, words):
    with pytest.raises(DataError) as found:
        load_architecture("C2", changes)
    assert words in str(found.value)
