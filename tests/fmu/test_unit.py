"""The unit in a simulator of another making: the driven trace again, and what FMI asks of it."""

import sys
import zipfile
from xml.etree import ElementTree

import numpy as np
import pytest
from forward.commands import asked_on_the_hill
from powertrain.test_source import written

from hevopt import DataError, load_architecture
from hevopt.commands.exporting import fmu as fmu_command
from hevopt.files.lookup import grouped_names, shipped_names

pytest.importorskip("pythonfmu")
fmpy = pytest.importorskip("fmpy")

from fmpy.fmi1 import FMICallException  # noqa: E402
from fmpy.fmi2 import FMU2Slave  # noqa: E402
from fmpy.validation import validate_fmu  # noqa: E402

from hevopt.fmu import export_fmu  # noqa: E402

STEP_S = 0.1
# Of each kind: clutch and gears, two boxes, two axles, torque converter, power split, series, lock-up clutch.
DRIVEN = (
    "A", "E", "p0_p4_diesel", "s60_b5_2022", "prius_1998", "series_1500", "series_parallel_1500",
)  # fmt: skip


@pytest.fixture(scope="module")
def units(tmp_path_factory):
    """Name -> file of a unit."""
    folder = tmp_path_factory.mktemp("units")
    for name in (*DRIVEN, "electric_compact"):
        export_fmu(load_architecture(name), folder / f"{name}.fmu", step_s=STEP_S)
    cell = tmp_path_factory.mktemp("cell")
    export_fmu(load_architecture(written(cell)), folder / "fuel_cell.fmu", step_s=STEP_S)
    return folder


class Host:
    """A unit in FMPy, its variables by name, and what it has logged."""

    def __init__(self, path, folder, **parameters):
        self.described = fmpy.read_model_description(path)
        self.variables = {v.name: v for v in self.described.modelVariables}
        self.logged = []
        fmpy.extract(path, folder)
        self.unit = FMU2Slave(
            guid=self.described.guid, unzipDirectory=folder, instanceName="one",
            modelIdentifier=self.described.coSimulation.modelIdentifier,
        )  # fmt: skip
        calls = fmpy.fmi2.fmi2CallbackFunctions()
        calls.logger = fmpy.fmi2.fmi2CallbackLoggerTYPE(
            lambda env, name, status, category, text: self.logged.append(text.decode())
        )
        calls.allocateMemory = fmpy.fmi2.fmi2CallbackAllocateMemoryTYPE(fmpy.calloc)
        calls.freeMemory = fmpy.fmi2.fmi2CallbackFreeMemoryTYPE(fmpy.free)
        self.unit.instantiate(callbacks=calls, loggingOn=True)
        self.begin(**parameters)

    def begin(self, **parameters):
        self.unit.setupExperiment(startTime=0.0)
        self.unit.enterInitializationMode()
        self.set(**parameters)
        self.unit.exitInitializationMode()
        self.time_s = 0.0

    def set(self, **values):
        for name, value in values.items():
            variable = self.variables[name]
            setter = getattr(self.unit, f"set{variable.type}")
            setter([variable.valueReference], [value])

    def get(self, name):
        variable = self.variables[name]
        return getattr(self.unit, f"get{variable.type}")([variable.valueReference])[0]

    def step(self, step_s=STEP_S):
        self.unit.doStep(self.time_s, step_s)
        self.time_s += step_s


@pytest.fixture
def host(units, monkeypatch, tmp_path):
    """Makes hosts, whose units are gone in the end; a unit puts its folder before all others."""
    monkeypatch.setattr(sys, "path", list(sys.path))
    made = []

    def make(name, **parameters):
        made.append(Host(units / f"{name}.fmu", tmp_path / str(len(made)), **parameters))
        return made[-1]

    yield make
    for one in made:
        one.unit.terminate()
        one.unit.freeInstance()


def asked_by(asked):
    """Commands as inputs of a unit, those of which it may have none left out where they ask for nothing."""
    given = {
        "force_asked_n": asked.force_n, "hold": asked.hold, "grade": asked.grade, "engine_on": asked.engine_on,
        "gear_asked": asked.gear, "clutch_open": asked.clutch_open, "lock_up_open": asked.lock_up_open,
        "engine_speed_asked_radps": asked.engine_radps, "engine_torque_asked_nm": asked.engine_nm,
        "clutch_closed": asked.clutch_closed,
    }  # fmt: skip
    given |= {f"{box.replace(' ', '_')}_gear_asked": gear for box, gear in asked.gears}
    return given | {f"{name}_asked_nm": torque for name, torque in asked.machines_nm}


@pytest.mark.parametrize("name", DRIVEN)
def test_a_unit_drives_as_the_forward_loop_does(host, name):
    run, _, commands = asked_on_the_hill(name, STEP_S)
    one = host(name)
    flows, last = run.books.flows, len(commands)
    machines = [machine for machine, _ in run.car.driveline.machines]
    tells = [f"{m}_{what}" for m in machines for what in ("torque_nm", "speed_radps")]
    for k, asked in enumerate(commands[:last]):
        given = asked_by(asked)
        for name in [*given]:
            if name not in one.variables:
                assert not given.pop(name) or name == "gear_asked", name
        one.set(**given)
        one.step()
        assert one.get("speed_mps") == run.speed_mps[k + 1], k
        if k % 10 == 0:
            for told in ("fuel_kgps", "engine_torque_nm", "battery_power_w", *tells):
                assert one.get(told) == flows[told][k], (k, told)
            assert one.get("soc") == run.soc[k + 1] and one.get("gear") == run.gear[k]
            assert one.get("engine_phase") == run.engine[k]
    assert one.get("fuel_kg") == pytest.approx(run.fuel_kg, rel=1e-12)
    assert one.get("distance_m") == pytest.approx(run.distance_m, rel=1e-12)
    assert one.get("unbalanced_w") < 1e-6 and not one.get("off_map") and not one.logged


@pytest.mark.parametrize("name", DRIVEN)
def test_a_unit_is_valid_and_has_inputs_and_outputs_for_each_machine(units, name):
    path = units / f"{name}.fmu"
    assert validate_fmu(str(path)) == []
    described = {v.name: v for v in fmpy.read_model_description(path).modelVariables}
    car = load_architecture(name)
    for machine, _ in car.driveline.machines:
        for what, unit in (("torque_nm", "N.m"), ("speed_radps", "rad/s")):
            told = described[f"{machine}_{what}"]
            assert told.unit == unit and told.causality == "output"
    asked = {n for n, v in described.items() if v.causality == "input" and n.endswith("_asked_nm")}
    free = car.driveline.free_engine_speed
    assert asked == {
        "A": set(), "prius_1998": {"engine_torque_asked_nm"}, "series_1500": {"engine_torque_asked_nm"},
        "p0_p4_diesel": {"machine_asked_nm", "machine_2_asked_nm"},
        "series_parallel_1500": {"engine_torque_asked_nm", "machine_asked_nm"},
    }.get(name, {"machine_asked_nm"})  # fmt: skip
    assert ("engine_speed_asked_radps" in described) == free == ("clutch_open" not in described)
    assert ("lock_up_open" in described) == (name == "s60_b5_2022")
    assert ("clutch_closed" in described) == (name == "series_parallel_1500")


@pytest.mark.parametrize("name", [*DRIVEN, "electric_compact"])
def test_full_force_and_full_brakes_are_driven_and_stay_finite(host, name):
    one = host(name)
    top = {"engine_speed_asked_radps": 300.0, "engine_torque_asked_nm": 1e4}
    one.set(force_asked_n=2e4, **{n: v for n, v in top.items() if n in one.variables})
    for k in range(160):
        if k == 100:
            one.set(force_asked_n=-2e4)
        one.step()
        for variable in one.variables.values():
            assert np.isfinite(one.get(variable.name)), (k, variable.name)
    assert not one.logged and one.get("distance_m") > 50


def test_a_fuel_cell_gives_the_power_that_is_asked_of_it(host):
    one = host("fuel_cell")
    assert "engine_speed_asked_radps" not in one.variables and "nox_kg" not in one.variables
    assert one.variables["source_power_asked_w"].max == "45000.0"
    one.set(force_asked_n=1000.0, source_power_asked_w=15e3)
    for _ in range(60):
        one.step()
    # Fuel at 15 kW by its file.
    assert one.get("fuel_kgps") == pytest.approx(0.208e-3, rel=1e-9) and one.get("speed_mps") > 3
    one.set(source_power_asked_w=90e3)
    one.step()
    assert one.get("fuel_kgps") == pytest.approx(0.682e-3, rel=1e-6) and not one.logged


@pytest.mark.parametrize("name", ["A", "prius_1998"])
def test_fmpys_own_loop_simulates_it(units, name):
    asked = np.array(
        [(0.0, 1500.0), (8.0, 1500.0)], dtype=[("time", float), ("force_asked_n", float)]
    )
    found = fmpy.simulate_fmu(
        str(units / f"{name}.fmu"), stop_time=8.0, output_interval=STEP_S, input=asked,
        output=["speed_mps", "distance_m", "stored_j"],
    )  # fmt: skip
    assert len(found) == 81 and (np.diff(found["speed_mps"]) > -1e-9).all()
    assert np.isfinite(found["stored_j"]).all() and found["distance_m"][-1] > 15


def test_a_unit_says_what_it_takes_and_tells_in_units_with_start_values(units, host):
    assert validate_fmu(str(units / "E.fmu")) == []
    one = host("E")
    told = one.variables
    assert told["force_asked_n"].unit == "N" and float(told["force_asked_n"].start) == 0
    assert told["fuel_kgps"].unit == "kg/s" and told["fuel_kgps"].causality == "output"
    assert told["gear_asked"].min == "1" and told["gear_asked"].max == "6"
    assert float(told["soc_start"].start) == load_architecture("E").soc_start
    assert "machine_asked_nm" not in host("A").variables  # its machine obeys the load alone
    for variable in told.values():
        assert variable.description and (variable.unit or variable.type != "Real")
    assert one.described.coSimulation.canGetAndSetFMUstate
    assert not one.described.coSimulation.canSerializeFMUstate


def pulled(one, seconds=2.0, step_s=STEP_S):
    one.set(force_asked_n=1500.0)
    for _ in range(round(seconds / step_s)):
        one.step(step_s)
    return one.get("speed_mps"), one.get("soc")


def test_longer_communication_steps_are_several_of_its_own(host):
    assert pulled(host("A")) == pulled(host("A"), step_s=4 * STEP_S)


@pytest.mark.parametrize(
    ("step_s", "fault"),
    [
        (0.25, "communication step 0.25 s is no whole number of the unit's own step, 0.1 s"),
        (0.02, "communication step 0.02 s is no whole number"),
        (0.0, "communication step 0 s; allowed: above 0"),
        (-0.1, "communication step -0.1 s; allowed: above 0"),
    ],
)
def test_a_wrong_step_is_refused_with_a_message_and_the_car_stays_as_it_was(host, step_s, fault):
    one = host("A")
    before = pulled(one, 0.5)
    with pytest.raises(FMICallException):
        one.step(step_s)
    assert any(fault in line for line in one.logged)
    assert (one.get("speed_mps"), one.get("soc")) == before
    one.step()
    assert one.get("speed_mps") > before[0]


@pytest.mark.parametrize(
    ("wrong", "fault"),
    [
        ({"gear_asked": 9}, "gear 9; allowed: 1 to 6"),
        ({"force_asked_n": float("nan")}, "force_n nan; allowed: finite numbers"),
    ],
)
def test_a_wrong_input_is_refused_with_a_message(host, wrong, fault):
    one = host("A")
    one.set(**wrong)
    with pytest.raises(FMICallException):
        one.step()
    assert any(fault in line for line in one.logged)


def test_wrong_parameters_are_told_and_no_step_is_driven(host):
    one = host("A", step_s=0.5, soc_start=2.0)
    assert any("parameters: step 0.5 s" in line for line in one.logged)
    with pytest.raises(FMICallException):
        one.step()


def test_a_unit_is_put_back_to_a_state_and_reset(host):
    one = host("E", soc_start=0.55)
    pulled(one)
    kept = one.unit.getFMUstate()
    first = pulled(one)
    one.unit.setFMUstate(kept)
    assert pulled(one) == first
    one.unit.freeFMUstate(kept)
    one.unit.reset()
    one.begin(soc_start=0.65)
    assert one.get("speed_mps") == 0 and one.get("soc") == pytest.approx(0.65)


def test_two_units_of_two_cars_run_beside_each_other(host):
    alone = pulled(host("A"))
    one, other = host("A"), host("E")
    for unit in (one, other):
        unit.set(force_asked_n=1500.0)
    for _ in range(20):
        one.step(), other.step()
    assert (one.get("speed_mps"), one.get("soc")) == alone
    assert other.get("speed_mps") != alone[0]


def test_the_same_car_gives_the_same_file_and_its_changes_are_in_it(tmp_path):
    changed = load_architecture("C2", {"car.mass_kg": 1400, "machine.scale.power": 1.2})
    for name in ("one", "two"):
        export_fmu(changed, tmp_path / f"{name}.fmu")
    assert (tmp_path / "one.fmu").read_bytes() == (tmp_path / "two.fmu").read_bytes()
    with zipfile.ZipFile(tmp_path / "one.fmu") as archive:
        archive.extractall(tmp_path / "out")
    read = load_architecture(tmp_path / "out/resources/car/architecture.toml")
    assert read.vehicle.mass_kg == changed.vehicle.mass_kg != 1400 + 70
    assert np.array_equal(read.machines[0].limit_nm(np.arange(500.0)),
                          changed.machines[0].limit_nm(np.arange(500.0)))  # fmt: skip
    root = ElementTree.parse(tmp_path / "out/modelDescription.xml").getroot()
    assert root.get("modelName") == "hevopt_C2"


@pytest.mark.parametrize(
    "name", [*shipped_names("architectures", "toml"), *grouped_names("architectures", "toml")]
)
def test_every_shipped_car_is_a_unit(name, tmp_path):
    export_fmu(load_architecture(name), tmp_path / "car.fmu")
    assert validate_fmu(str(tmp_path / "car.fmu")) == []


def test_an_end_of_a_map_is_told_and_the_car_stays_as_it_was(host):
    one = host("s60_b5_2022", speed_start_mps=30.0)
    one.set(force_asked_n=3000.0)
    with pytest.raises(FMICallException):
        one.step()
    assert any("the map of its engine has no data at" in line for line in one.logged)
    assert one.get("speed_mps") == 30.0 and np.isfinite(one.get("stored_j"))
    one.set(gear_asked=5)
    one.step()
    assert one.get("speed_mps") != 30.0


def test_what_cannot_be_a_unit_is_refused_in_one_sentence(tmp_path):
    out = tmp_path / "car.fmu"
    with pytest.raises(DataError, match=r"must end in \.fmu"):
        export_fmu(load_architecture("A"), tmp_path / "car.zip")
    with pytest.raises(DataError, match=r"changed after .* was read"):
        export_fmu(load_architecture("A").of_mass(1500.0), out)
    with pytest.raises(DataError, match="No such folder"):
        export_fmu(load_architecture("A"), tmp_path / "none" / "car.fmu")
    assert not out.exists()


def test_the_command_writes_a_unit(tmp_path, capsys):
    out = tmp_path / "c2.fmu"
    fmu_command(architecture="C2", out=out, step=0.02, **{
        "soc_start": None, "soc_min": None, "soc_max": None, "auxiliaries_w": None, "mass_kg": None,
        "start_cost_g": None, "changes": ["tyre.friction=0.9"],
    })  # fmt: skip
    assert validate_fmu(str(out)) == [] and "tyre.friction = 0.9" in capsys.readouterr().out
