"""Parts of the mean-value engine against closed forms, and where they are smooth."""

from math import pi, sqrt

import numpy as np
import pytest

from hevopt.mean_value import _gas_kernels as gas_laws
from hevopt.mean_value._cylinder_kernels import filling
from hevopt.mean_value._gas_kernels import State
from hevopt.mean_value._turbo_kernels import TANGENT, compressor, place_on_line, turbine
from hevopt.mean_value.parameters import Compressor, Cylinders, Gas, Turbine
from hevopt.mean_value.rotor import scaled_inertia_kgm2

GAS = Gas()
WHEEL = Compressor(0.041, 0.58, 2.5, 0.018, 0.030, 0.27, 0.070, 0.70, 0.60, 0.012)
TURBINE = Turbine(0.0185, 2.35e-4, 2.9, 0.55, 0.65)
KRPM = 2e3 * pi / 60


def air(pressure: float, kelvin: float = 300.0, burnt: float = 0.0) -> State:
    a, b = gas_laws.coefficients.py_func(burnt, GAS)
    density = pressure / (GAS.constant_jpkgk * kelvin)
    return State(pressure, kelvin, burnt, density, kelvin * (a + b * kelvin / 2), a + b * kelvin)


def test_temperature_is_the_inverse_of_internal_energy():
    for burnt in (0.0, 0.3, 1.0):
        for kelvin in (250.0, 900.0, 1500.0):
            a, b = 943 + 42 * burnt, 0.206 + 0.084 * burnt
            energy = (a - 287) * kelvin + b * kelvin**2 / 2
            assert gas_laws.temperature_of_energy.py_func(energy, burnt, GAS) == pytest.approx(
                kelvin, rel=1e-14
            )


def test_with_constant_heat_capacity_temperature_is_energy_over_it_and_streams_mix_by_enthalpy():
    plain = Gas(287.0, 1000.0, 0.0, 1000.0, 0.0)
    assert gas_laws.temperature_of_energy.py_func(713.0 * 400, 0.5, plain) == pytest.approx(400.0)
    hot, cold = (gas_laws.enthalpy.py_func(t, 0.0, plain) for t in (800.0, 300.0))
    mixed = (0.25 * hot + 0.75 * cold) / 1000.0
    assert mixed == pytest.approx(0.25 * 800 + 0.75 * 300)


def test_a_restriction_is_smooth_at_no_flow_and_at_its_limit_and_the_same_both_ways():
    limit, h = 1000.0, 3.4e5

    def flow(dp: float) -> float:
        # Equal densities, whatever the pressures.
        ahead, behind = (air(1e5)._replace(pressure=p) for p in (1e5 + dp, 1e5))
        return gas_laws.restriction(ahead, behind, h, limit)

    for dp in (0.1, 300.0, 999.0, 1001.0, 5e4):
        assert flow(dp) == -flow(-dp)
    for at in (0.0, limit):
        left, right = ((flow(at + e) - flow(at)) / e for e in (-1e-3, 1e-3))
        assert left == pytest.approx(right, rel=1e-4)
        assert flow(at + 1e-9) == pytest.approx(flow(at - 1e-9), abs=1e-12)
    assert flow(4000.0) == pytest.approx(sqrt(air(1e5).density * 4000.0 / h))


def test_the_recirculation_valve_chokes_and_turns_round():
    def flow(p4: float, p3: float) -> float:
        return gas_laws.valve(air(p4, 700.0), air(p3, 700.0), 1.6e-4, 0.65, GAS)

    assert flow(1.5e5, 1.5e5) == 0.0
    assert flow(1.5e5, 1.2e5) == -flow(1.2e5, 1.5e5)
    assert flow(1.5e5, 0.9e5) == pytest.approx(1.6e-4 * 1.5e5 / sqrt(287.0 * 700.0))
    assert flow(1.5e5, 0.5e5) == flow(1.5e5, 0.9e5)


@pytest.mark.parametrize("joint", [1.0, TANGENT, TANGENT * (1 - 2.5)])
def test_the_speed_line_is_smooth_where_its_pieces_meet(joint):
    left, right = (
        (place_on_line(joint + e, 2.5) - place_on_line(joint, 2.5)) / e for e in (-1e-7, 1e-7)
    )
    assert left == pytest.approx(right, rel=1e-4)


def test_a_standing_wheel_lets_through_as_much_backwards_as_forwards():
    # With little pressure, so that densities and isentropic work hardly differ.
    there, back = (
        compressor(0.0, air(a), air(b), WHEEL, GAS) for a, b in ((1.02e5, 1e5), (1e5, 1.02e5))
    )
    assert there.flow > 0.01 > -0.01 > back.flow
    assert back.flow == pytest.approx(-there.flow, rel=0.1)
    dh = 1004.8 * 300 * (1 - (1 / 1.02) ** (287 / 1004.8))
    choke = WHEEL.choke_flow - WHEEL.surge_flow
    expected = air(1.02e5).density * pi / 4 * 0.041**2 * choke * sqrt(2 * dh / 2.5 / 0.58)
    assert there.flow == pytest.approx(expected, rel=0.03)
    assert compressor(0.0, air(1e5), air(1e5), WHEEL, GAS).torque == pytest.approx(0.0, abs=1e-5)


def test_at_low_speed_the_compressor_raises_pressure_as_an_incompressible_fan_and_takes_power_as_its_cube():
    powers = []
    for rim in (1.0, 2.0, 4.0):
        speed = rim / (0.041 / 2)
        # Where the head is half of the most, Psi = dp / (rho U²) however slow.
        dp = 0.29 * air(1e5).density * rim**2
        found = compressor(speed, air(1e5), air(1e5 + dp), WHEEL, GAS)
        assert found.head == pytest.approx(0.5, rel=1e-4)
        powers.append(found.torque * speed)
    assert np.diff(np.log2(powers)) == pytest.approx([3, 3], abs=2e-3)


@pytest.mark.parametrize("krpm", [1.0, 26.0, 100.0, 200.0])
def test_a_compressor_never_gives_more_work_than_it_takes(krpm):
    speed = krpm * KRPM
    top = (0.58 * (speed * 0.0205) ** 2 / (1004.8 * 300) + 1) ** (1004.8 / 287)
    efficiencies = []
    for share in np.linspace(0.01, 0.99, 50):
        found = compressor(speed, air(1e5), air(1e5 * (1 + share * (top - 1))), WHEEL, GAS)
        ideal = found.head * 0.58 * (speed * 0.0205) ** 2 * found.flow
        efficiencies.append(ideal / (found.torque * speed))
    assert 0.6 < max(efficiencies) < 0.75
    assert min(efficiencies) > 0


def test_a_turbine_stalls_with_twice_its_best_torque_idles_at_twice_its_best_speed_and_rests_without_pressure():
    four, five = air(1.6e5, 800.0, 0.6), air(1.05e5, 700.0, 0.6)
    stalled = turbine(0.0, 0.4, four, five, TURBINE, GAS)
    work = four.cp * 800.0 * (1 - (1.05 / 1.6) ** (287 / four.cp))
    best = 0.65 * sqrt(2 * work) / 0.0185
    assert stalled.torque == pytest.approx(2 * 0.55 * stalled.flow * work / best)
    assert stalled.efficiency == 0
    at_best = turbine(best, 0.4, four, five, TURBINE, GAS)
    assert at_best.torque == pytest.approx(stalled.torque / 2)
    assert at_best.efficiency == pytest.approx(0.55)
    assert turbine(2 * best, 0.4, four, five, TURBINE, GAS).torque == pytest.approx(0, abs=1e-9)
    still = turbine(9000.0, 0.4, four, four, TURBINE, GAS)
    assert (still.flow, still.torque) == (0, 0)
    assert turbine(9000.0, 0.4, five, four, TURBINE, GAS).flow < 0


def test_filling_falls_with_back_pressure_and_is_a_share_of_what_is_swept():
    cylinders = Cylinders(
        1248e-6, 0.082, 17.6, 0.9, 0.06, 2400 * pi / 30, 42.9e6, 14.5, 0.476, 6.853, 14.85,
        0.15, 0.3, 1.2e5, 680, 1e4, 0.2, 0.1
    )  # fmt: skip
    speed = 2400 * pi / 30
    even = filling(speed, air(2e5), air(2e5), cylinders)
    assert even == pytest.approx(0.9 * air(2e5).density * 1248e-6 * 20)
    assert filling(speed, air(2e5), air(3e5), cylinders) < even
    assert filling(0.0, air(2e5), air(2e5), cylinders) == 0


def test_a_rotor_nobody_weighed_lies_between_two_that_were():
    mean, low, high = scaled_inertia_kgm2(0.041)
    assert (low, high) == pytest.approx((5.364e-6, 7.071e-6), rel=1e-3)
    assert low < mean < high
    assert scaled_inertia_kgm2(0.082)[0] == pytest.approx(32 * mean)
