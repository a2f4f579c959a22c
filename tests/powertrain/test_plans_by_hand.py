"""Plans of two shipped hybrids in plain numbers, every step from the files: a series-parallel car and a P2 with a
dual clutch gearbox. What was chosen (engine turning, its speed where free, torques) is the plan's."""

import tomllib
from functools import lru_cache
from math import pi, sqrt

import numpy as np
import pytest

from hevopt import build_problem, load_architecture, load_cycle, simulate
from hevopt.files.lookup import shipped_folder
from hevopt.strategies import STRATEGIES

RPM = 30 / pi


@lru_cache
def read(name: str) -> dict:
    """A component's file."""
    folder = shipped_folder("architectures") / "components"
    return tomllib.loads((folder / f"{name}.toml").read_text())


def on_grid(table: dict, key: str, rpm: float, nm: float) -> float:
    """Bilinear in a cell of four values; a plane where that of low speed and high torque lacks."""
    speeds, torques, values = table["speed_rpm"], table["torque_nm"], table[key]
    i = max(n for n in range(len(speeds) - 1) if n == 0 or speeds[n] <= rpm)
    j = max(n for n in range(len(torques) - 1) if n == 0 or torques[n] <= nm)
    x = (rpm - speeds[i]) / (speeds[i + 1] - speeds[i])
    y = (nm - torques[j]) / (torques[j + 1] - torques[j])
    assert -1e-6 < x < 1 + 1e-6 and -1e-6 < y < 1 + 1e-6, (rpm, nm)
    low, up, right, far = (values[i + m][j + n] for m in (0, 1) for n in (0, 1))
    if up != up:
        assert y < x + 1e-6, (rpm, nm)
        return right + (low - right) * (1 - x) + (far - right) * y
    return (low * (1 - y) + up * y) * (1 - x) + (right * (1 - y) + far * y) * x


def fuel_kgps(engine: dict, scale: float, nm: float, radps: float) -> float:
    """Of an engine's map; none at the drag torque."""
    if radps == 0:
        return 0.0
    table, rpm, nm = engine["fuel_map"], radps * RPM, nm / scale
    drag = np.interp(rpm, table["speed_rpm"], table["motoring_torque_nm"])
    return 0.0 if nm <= drag + 1e-9 else scale * on_grid(table, "fuel_gps", rpm, nm) / 1e3


def mapped_loss_w(machine: dict, scale: float, nm: float, radps: float) -> float:
    """Of a machine's map, which is of one direction of turning."""
    if radps == 0 and nm == 0:
        return 0.0
    return scale * on_grid(machine["loss_map"], "loss_w", radps * RPM, nm / scale)


class Pack:
    """A battery: its energy over charge, and a step."""

    def __init__(self, data: dict) -> None:
        n, self.charge = data["cells_in_series"], data["capacity_ah"] * 3600.0
        self.eta = data["coulombic_efficiency"]
        if isinstance(data["open_circuit_v"], dict):
            line = data["open_circuit_v"]
            self.soc = [0.0, 1.0]
            self.volt = [n * (line["intercept"] + line["slope"] * soc) for soc in self.soc]
            self.out = self.into = [n * data["resistance_ohm"]] * 2
        else:
            self.soc, self.volt = data["curve_soc"], [n * u for u in data["open_circuit_v"]]
            self.out = [n * r for r in data["discharge_ohm"]]
            self.into = [n * r for r in data["charge_ohm"]]

        self.stored = [0.0]
        for i in range(len(self.soc) - 1):
            self.stored.append(self.stored[-1] + self.between(i, self.soc[i + 1]))

    def between(self, i: int, soc: float) -> float:
        """Energy from a point of the curve up to a charge before the next one: charge times the mean voltage."""
        share = (soc - self.soc[i]) / (self.soc[i + 1] - self.soc[i])
        volt = self.volt[i] + share * (self.volt[i + 1] - self.volt[i])
        return self.charge * (soc - self.soc[i]) * (self.volt[i] + volt) / 2

    def energy_j(self, soc: float) -> float:
        i = max(n for n in range(len(self.soc) - 1) if n == 0 or self.soc[n] <= soc)
        return self.stored[i] + self.between(i, soc)

    def after(self, energy_j: float, power_w: float, step_s: float) -> float:
        i = max(n for n in range(len(self.soc) - 1) if n == 0 or self.stored[n] <= energy_j)
        low, high = self.soc[i], self.soc[i + 1]
        for _ in range(60):
            middle = (low + high) / 2
            less = self.stored[i] + self.between(i, middle) < energy_j
            low, high = (middle, high) if less else (low, middle)
        resistance = self.into if power_w < 0 else self.out
        volt, ohm = (float(np.interp(low, self.soc, curve)) for curve in (self.volt, resistance))
        current = (volt - sqrt(volt * volt - 4 * ohm * power_w)) / (2 * ohm)
        return energy_j - step_s * volt * current * (self.eta if power_w < 0 else 1.0)


def passed(nm: float, ratio: float, eta: float) -> float:
    """Torque behind a pair of gears."""
    return nm * ratio * (eta if nm > 0 else 1 / eta)


def road_nm(car: dict, mass_kg: float, v: float, a: float) -> float:
    """Torque that the wheels ask for on a level road."""
    road, r = car["road_load"], car["tyre_radius_m"]
    rolling = mass_kg * 9.80665 * (road["rolling_c0"] + road.get("rolling_c1_spm", 0.0) * v)
    air = 0.5 * road["air_density_kgpm3"] * road["drag_area_m2"] * v * v
    return (rolling + air + (mass_kg + car["wheel_inertia_kgm2"] / r**2) * a) * r


def steps_of(run, problem, cycle):
    """Every step: length, mean speed, acceleration, the plan's flows, friction brakes' torque, fuel and power."""
    f, table = run.flows, problem.table
    for k in range(len(run.control)):
        dt = float(cycle.time_s[k + 1] - cycle.time_s[k])
        v = float(cycle.speed_mps[k + 1] + cycle.speed_mps[k]) / 2
        a = float(cycle.speed_mps[k + 1] - cycle.speed_mps[k]) / dt
        engine = f["engine_torque_nm"][k], f["engine_speed_radps"][k]
        burnt = (run.fuel_kg[k] - run.switch_fuel_kg[k]) / dt
        yield k, dt, v, a, engine, bool(table.controls[run.control[k]].engine_on), burnt


def check_charge(run, problem, pack: Pack) -> None:
    """Stored energy after every step, and no step beyond the window."""
    for k, power in enumerate(run.battery_power_w):
        before = float(run.energy_j[k] - run.switch_energy_j[k])
        after = pack.after(before, float(power), float(problem.table.step_s[k]))
        assert after == pytest.approx(run.energy_j[k + 1], abs=1e-3)
    window = [pack.energy_j(soc) for soc in (problem.battery.soc_min, problem.battery.soc_max)]
    assert window[0] - 1 < run.energy_j.min() and run.energy_j.max() < window[1] + 1


@pytest.fixture(scope="module")
def udds():
    return load_cycle("udds")


@lru_cache
def built(name: str):
    """The problem of a car on the UDDS."""
    return build_problem(load_architecture(name), load_cycle("udds"), levels=20)


def planned(name: str, strategy: str = "dp"):
    """A car on the UDDS, and a plan of it."""
    problem = built(name)
    return problem, simulate(problem, STRATEGIES[strategy].solve(problem).control)


def test_a_series_parallel_plan_is_what_plain_numbers_say(udds):
    problem, run = planned("series_parallel_1500")
    car, engine = read("car_prius_1998"), read("engine_petrol_1500_atkinson")
    generator, motor = read("machine_generator_15kw"), read("machine_motor_30kw")
    spinning = engine["inertia_kgm2"] + 2.5 * generator["inertia_kgm2"]
    f, seen = run.flows, {"locked": 0, "series": 0, "off": 0}
    for k, _, v, a, (engine_nm, engine_radps), on, burnt in steps_of(run, problem, udds):
        wheel_radps, accel = v / 0.287, a / 0.287
        sets = ((generator, 2.5, "machine"), (motor, 1.5, "machine_2"))
        torque = [f[f"{name}_torque_nm"][k] for *_, name in sets]
        speed = [f[f"{name}_speed_radps"][k] for *_, name in sets]
        assert speed[1] == pytest.approx(3.93 * wheel_radps, abs=1e-9)
        drive_nm = passed(torque[1], 3.93, 0.97)
        # What turns is a mass on the wheels in a car whose engine's speed is free.
        turning = 1.5 * motor["inertia_kgm2"] * 3.93**2
        if on and v > 0 and abs(engine_radps - 2.8 * wheel_radps) < 1e-9:
            seen["locked"] += 1
            drive_nm += passed(engine_nm + torque[0], 2.8, 0.97)
            turning += spinning * 2.8**2
        elif on:
            seen["series"] += 1
            assert engine_nm + torque[0] == pytest.approx(0, abs=1e-9)
        else:
            seen["off"] += 1
            assert engine_nm == engine_radps == torque[0] == speed[0] == 0
        if on:
            assert (
                speed[0] == pytest.approx(engine_radps, abs=1e-9) and engine_radps * RPM > 999.999
            )
            most = np.interp(engine_radps * RPM, *engine["full_load"].values())
            assert -40 - 1e-6 <= engine_nm <= most + 1e-6
        brake_nm = f["brake_power_w"][k] / wheel_radps if v > 0 else 0.0
        if v > 0:
            asked = road_nm(car, 1448.0, v, a)
            assert drive_nm - brake_nm == pytest.approx(asked + turning * accel, rel=1e-9, abs=1e-6)
            assert brake_nm > -1e-6 and (asked <= 0 or brake_nm < 1e-6)
        assert fuel_kgps(engine, 1.0, engine_nm, engine_radps) == pytest.approx(burnt, abs=1e-12)
        electric = 700.0
        for (machine, scale, _), nm, radps in zip(sets, torque, speed, strict=True):
            electric += nm * radps + mapped_loss_w(machine, scale, nm, radps)
        assert electric == pytest.approx(run.battery_power_w[k], rel=1e-9, abs=1e-6)
    assert min(seen.values()) > 30, seen
    check_charge(run, problem, Pack(read("battery_nimh_40")))


def p2_step(v, a, gear, engine, machine, on, burnt, brake_nm) -> tuple[str, float]:
    """What a step of the P2 is, and its battery power; engine, machine: torque and speed."""
    car, box = read("car_compact"), read("gearbox_dual_clutch_6")
    (engine_nm, engine_radps), (nm, radps) = engine, machine
    r, how = car["tyre_radius_m"], "off"
    ratio = 4.20 * box["ratios"][gear - 1] if gear else 0.0
    if v == 0:
        how = "standing"
        assert engine_nm + nm == pytest.approx(0, abs=1e-9) and (on or nm == 0)
    else:
        into, accel = ratio * v / r, a / r
        assert radps == pytest.approx(into, abs=1e-9)
        input_nm = nm - 0.074 * ratio * accel
        if on and gear and abs(engine_radps - into) < 1e-9:
            how = "closed" if burnt else "cut"
            input_nm += engine_nm - 1.6 * 0.1 * ratio * accel
        elif on and engine_nm > 1e-9 and gear:
            how = "slipping"
            assert engine_radps > into and gear == 1
            input_nm += engine_nm
        elif on:
            how = "open"
        asked = road_nm(car, 1370.0, v, a)
        drive_nm = passed(input_nm, ratio, 0.94) if gear else 0.0
        assert drive_nm - brake_nm == pytest.approx(asked, rel=1e-9, abs=1e-6)
        assert brake_nm > -1e-6 and (asked <= 0 or brake_nm < 1e-6)
        if nm * radps < -300 and asked < 0 and not on:
            share = np.interp(3.6 * v, car["braking"]["speed_kmh"], car["braking"]["machine_share"])
            assert asked + brake_nm >= share * asked - 1e-6
    turning = radps > 0 or nm != 0
    loss = 54.7 + 0.296 * radps + 0.00204 * radps**2 + 0.194 * nm**2 if turning else 0.0
    return how, nm * radps + loss + 250.0


@pytest.mark.parametrize(
    ("strategy", "ways"),
    [("dp", {"closed", "off", "standing"}),
     ("baseline", {"closed", "cut", "slipping", "open", "standing"})],
)  # fmt: skip
def test_a_p2_plan_is_what_plain_numbers_say(udds, strategy, ways):
    problem, run = planned("p2_petrol_dct", strategy)
    engine, f, seen = read("engine_petrol_1000"), run.flows, dict[str, int]()
    for k, _, v, a, (engine_nm, engine_radps), on, burnt in steps_of(run, problem, udds):
        machine = f["machine_torque_nm"][k], f["machine_speed_radps"][k]
        brake_nm = f["brake_power_w"][k] / (v / 0.3132) if v else 0.0
        gear = int(problem.table.signals.gear[k]) if v > 0 else 0
        own = (engine_nm, engine_radps), machine
        how, electric_w = p2_step(v, a, gear, *own, on, burnt, brake_nm)
        seen[how] = seen.get(how, 0) + 1
        if on:
            assert engine_radps * RPM > 898 - 1e-6 and engine_nm * engine_radps < 80.5e3
        else:
            assert engine_nm == engine_radps == burnt == 0
        assert fuel_kgps(engine, 1.6, engine_nm, engine_radps) == pytest.approx(burnt, abs=1e-12)
        assert electric_w == pytest.approx(run.battery_power_w[k], rel=1e-9, abs=1e-6)
    assert {how for how, count in seen.items() if count > 10} == ways, seen
    check_charge(run, problem, Pack(read("battery_liion_64")))


def test_a_start_takes_its_fuel_and_the_shafts_energy_from_the_battery(udds):
    problem, run = planned("p2_petrol_dct")
    on = np.array([problem.table.controls[c].engine_on for c in run.control])
    gears, ratios, starts = problem.table.signals.gear, read("gearbox_dual_clutch_6")["ratios"], 0
    for k in np.flatnonzero(on[1:] & ~on[:-1]) + 1:
        if udds.speed_mps[k] > 0 and gears[k] == gears[k - 1]:
            radps = 4.20 * ratios[gears[k] - 1] * udds.speed_mps[k] / 0.3132
            spin_j = 0.5 * 1.6 * 0.1 * radps**2 / 0.85
            assert run.switch_energy_j[k] == pytest.approx(spin_j, rel=1e-9)
            assert run.switch_fuel_kg[k] == pytest.approx(1.6 * 0.15e-3, rel=1e-12)
            starts += 1
    assert starts > 3
