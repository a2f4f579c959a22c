"""Imports as functions of Python: what they give is what the commands write, and can be used as it is."""

from pathlib import Path

import numpy as np
import pytest

from hevopt import (
    DataError,
    coastdown,
    compare,
    import_cycle,
    import_drives,
    import_map,
    load_architecture,
    load_cycle,
)

HERE = Path(__file__).parent
LOG, PARKED, RUNS = (
    HERE / "logs" / f"{name}.csv" for name in ("torque_pro", "gap_parked", "cd_clean")
)
MAP, CURVES = (HERE / "faults" / f"engine_round_torques{name}.csv" for name in ("", "_full"))
LIKE = "engine_diesel_1600"


def test_a_drive_is_the_command_s_cycle_and_can_be_driven(hevopt):
    imported = import_cycle(str(LOG))
    imported.write("ours.csv")
    assert hevopt("cycles", "import", str(LOG), "--out", "theirs.csv").status == 0
    assert Path("ours.csv").read_bytes() == Path("theirs.csv").read_bytes()
    assert np.array_equal(load_cycle("ours.csv").speed_mps, imported.cycle.speed_mps)
    first, second = import_drives(PARKED, gaps="split")
    assert first.cycle.distance_m > 0 and second.cycle.distance_m > 0
    row = compare(imported.cycle, "A", "baseline").rows[0]
    assert row.fuel_l_per_100km > 0


@pytest.mark.parametrize(
    ("options", "said"),
    [
        ({"gaps": "split"}, "2 trips; import_drives gives all of them"),
        ({"gap": "cut"}, "setting 'gap' not found; close matches: gaps"),
        ({"gaps": "cuts"}, "close matches: cut"),
        ({"altitude_baseline_m": "far"}, "altitude_baseline_m = 'far'; needed: a number"),
        ({}, "long gaps"),
    ],
)
def test_a_wrong_option_of_a_drive_is_one_message(options, said):
    with pytest.raises(DataError) as error:
        import_cycle(PARKED, **options)
    assert said in str(error.value)


def test_a_cycle_file_keeps_its_suffix_and_its_source(tmp_path):
    log = tmp_path / "log.csv"
    log.write_bytes(LOG.read_bytes())
    imported = import_cycle(log)
    with pytest.raises(DataError, match=r"ends in \.csv"):
        imported.write(tmp_path / "log.txt")
    with pytest.raises(DataError, match="choose another"):
        imported.write(log)
    assert log.read_bytes() == LOG.read_bytes()


def test_a_map_is_the_command_s_component_and_can_be_put_into_a_car(hevopt):
    found = import_map(
        MAP, "engine", like=LIKE, full_load=CURVES, motoring=str(CURVES), values={"idle_rpm": 1000}
    )
    plot = found.write("ours.toml")
    assert plot == Path("ours.png") and plot.read_bytes()[:4] == b"\x89PNG"
    words = (
        "--kind",
        "engine",
        "--like",
        LIKE,
        "--full-load",
        str(CURVES),
        "--motoring",
        str(CURVES),
    )
    status, out, err = hevopt(
        "maps", "import", str(MAP), *words, "--set", "idle_rpm=1000", "--out", "theirs.toml"
    )
    assert status == 0, err
    assert Path("ours.toml").read_bytes() == Path("theirs.toml").read_bytes()
    assert Path("ours.png").read_bytes() == Path("theirs.png").read_bytes()
    assert found.coverage[-1] in out
    car = load_architecture("C2", {"engine": "./ours.toml"})
    assert car.engine.name == "engine_round_torques"
    found.write("ours.toml")  # an import's own file may be replaced
    Path("mine.toml").write_text("name = 'mine'\n")
    with pytest.raises(DataError, match="has not written it"):
        found.write("mine.toml")


@pytest.mark.parametrize(
    ("given", "said"),
    [
        ({"kind": "motor"}, "available: engine, machine, battery, gearbox, compressor, turbine"),
        ({"rows": "fuel"}, "rows = 'fuel'; allowed: speed, torque"),
        ({"columns": {"sped": "n"}}, "columns: role 'sped' not found; close matches: speed"),
        ({"like": None}, "the component needs displacement_cm3"),
        ({"full_load": "nix.csv"}, "nix.csv"),
    ],
)
def test_a_wrong_option_of_a_map_is_one_message(given, said):
    options = {"kind": "engine", "like": LIKE, "full_load": CURVES, "motoring": CURVES}
    with pytest.raises(DataError) as error:
        import_map(MAP, **(options | given))
    assert said in str(error.value)


def test_coast_downs_are_the_command_s_car_and_its_coefficients(hevopt):
    found = coastdown(RUNS, mass_kg=1350, like="car_compact")
    found.write("ours.toml")
    found.write_plot("ours.svg")
    words = ("coastdown", str(RUNS), "--mass-kg", "1350", "--like", "car_compact")
    status, out, err = hevopt(*words, "--out", "theirs.toml", "--plot", "theirs.svg")
    assert status == 0, err
    assert Path("ours.toml").read_bytes() == Path("theirs.toml").read_bytes()
    assert Path("ours.svg").read_bytes() == Path("theirs.svg").read_bytes()
    assert all(line in out for line in found.results)
    load = load_architecture("A", {"car": "./ours.toml"}).contents["car"]["road_load"]
    assert load["coastdown_c0_n"] == pytest.approx(found.fit.coefficients[0], rel=1e-6)
    assert "c0_n=" in repr(found)


@pytest.mark.parametrize(
    ("given", "said"),
    [
        ({"mass_kg": None}, "--mass-kg is missing"),
        ({"mass_kg": "heavy"}, "--mass-kg 'heavy'"),
        ({"like": None}, "the inertia of wheels and shafts is missing"),
        ({"directions": [1, -1]}, "direction"),
        ({"units": {"sped": "km/h"}}, "units: role 'sped' not found; close matches: speed"),
        ({"values": {"doors": 5}}, "doors = 5; allowed: name"),
    ],
)
def test_a_wrong_option_of_coast_downs_is_one_message(given, said):
    with pytest.raises(DataError) as error:
        coastdown([RUNS], **({"mass_kg": 1350, "like": "car_compact"} | given))
    assert said in str(error.value)
