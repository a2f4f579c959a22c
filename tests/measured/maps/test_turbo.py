"""Maps of compressors and turbines as the compact maps nearest to them, against maps that are known."""

from pathlib import Path

import numpy as np
import pytest
from diesels import shipped
from map_bench import write

from hevopt import DataError, import_map
from hevopt.mean_value._gas_kernels import State
from hevopt.mean_value._turbo_kernels import turbine
from hevopt.mean_value.compressor_map import speed_line
from hevopt.mean_value.parameters import Ambient, Gas
from hevopt.measured.maps.turbo import ImportedTurbo

EXAMPLES = Path(__file__).parents[3] / "examples"
RPM = np.pi / 30
ENGINE = shipped("compact_1300").diesel.engine
LIKE = {"like": "engine_diesel_1300"}
HEADS = "speed [rpm],flow [kg/s],pressure ratio,efficiency [-]"
AMBIENT = (Ambient().temperature_k, Ambient().pressure_pa)


@pytest.fixture
def folder(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    return tmp_path


def own_lines(krpms=(60, 100, 140, 180), points=8):
    """Columns of the shipped compressor's own map, away from where no pressure is left."""
    found = []
    for krpm in krpms:
        line = speed_line(ENGINE.compressor, 1e3 * krpm * RPM, Gas(), Ambient())
        k = np.linspace(0, 52, points).astype(int)
        found.append(np.column_stack(
            [np.full(points, 1e3 * krpm), line.flow_kgps[k], line.ratio[k], line.efficiency[k]]
        ))  # fmt: skip
    return np.concatenate(found).T


def imported(file, kind, **more) -> ImportedTurbo:
    found = import_map(file, kind, **{**LIKE, **more}).imported
    assert isinstance(found, ImportedTurbo)
    return found


def test_points_of_a_compact_compressor_give_that_compressor(folder):
    write("map.csv", HEADS, *own_lines())
    found = imported("map.csv", "compressor", reference=AMBIENT)
    assert found.fit.wheel == pytest.approx(ENGINE.compressor, rel=2e-3, abs=2e-4)
    assert np.abs(found.fit.off).max() < 1e-3 and np.abs(found.fit.efficiency_off).max() < 1e-3


def test_a_unit_of_flow_that_fits_as_well_is_warned_of(folder):
    """Grams per second said to be kilograms per hour; and a compressor of a truck."""
    speed, flow, *rest = own_lines()
    for share, warned in ((1.0, False), (1 / 3.6, True), (6.0, True)):
        write("map.csv", HEADS, speed, share * flow, *rest)
        wheel = {"mean_value.compressor.wheel_diameter_mm": 41.0 * max(share, 1.0) ** 0.5}
        notes = "\n".join(imported("map.csv", "compressor", reference=AMBIENT, values=wheel).notes)
        told = "WARNING: the engine takes about 88 g/s at rated power, and the map goes up to"
        assert (told in notes) == warned, notes


def test_what_flow_and_speed_are_corrected_to_makes_no_difference(folder):
    """The same wheel by another bench's reference, and reduced; in pounds and kilopascals."""
    speed, flow, *rest = own_lines()
    kelvin, pascal = 288.15, 0.98e5
    there = np.sqrt(kelvin / AMBIENT[0])
    write("map.csv", HEADS, speed, flow, *rest)
    write("other.csv", HEADS.replace("kg/s", "lb/min"), speed * there,
          flow / there * pascal / AMBIENT[1] / 0.45359237 * 60, *rest)  # fmt: skip
    reduced = HEADS.replace("rpm", "rpm/√K").replace("kg/s", "kg·√K/(s·kPa)")
    root = np.sqrt(AMBIENT[0])
    write("reduced.csv", reduced, speed / root, flow * root / AMBIENT[1] * 1e3, *rest)
    wheels = [
        imported(file, "compressor", reference=reference).fit.wheel
        for file, reference in (("map.csv", AMBIENT), ("other.csv", (kelvin, pascal)), ("reduced.csv", None))
    ]  # fmt: skip
    for other in wheels[1:]:
        assert other == pytest.approx(wheels[0], rel=1e-5, abs=1e-7)


def test_points_of_a_compact_turbine_give_that_turbine_at_every_vane_position(folder):
    wheel, gas = ENGINE.turbine, Gas()
    cp = 985 - 21 + 873 * 0.248  # half burnt at 873 K
    rows = []
    for opening in (0.3, 0.6, 1.0):
        for rpm_root_k in (2500.0, 4500.0):
            for ratio in (1.3, 1.8, 2.6):
                hot, cold = (
                    State(p, 873.0, 0.5, p / 287 / 873, 0.0, cp) for p in (ratio * 1e5, 1e5)
                )
                speed = rpm_root_k * RPM * np.sqrt(873)
                out = turbine(speed, opening, hot, cold, wheel, gas)
                flow = out.flow * np.sqrt(873) / (ratio * 1e5) * 1e6
                rows.append((rpm_root_k, 100 * opening, flow, ratio, out.efficiency))
    write(
        "map.csv",
        "n [rpm/√K],vanes [%],flow [kg/s√K/MPa],expansion ratio,eta [-]",
        *np.transpose(rows),
    )
    found = imported("map.csv", "turbine")
    assert found.fit.wheel == pytest.approx(wheel, rel=1e-3)
    shares = found.fit.areas_m2 / found.fit.wheel.area_m2
    assert shares == pytest.approx([0.3, 0.6, 1.0], rel=1e-3)
    assert found.fit.positions == pytest.approx([0.3, 0.6, 1.0])


def test_lines_of_another_shape_lie_near_and_the_engine_with_both_drives(hevopt, folder):
    """The examples: super-ellipses and a nozzle."""
    diameter = "mean_value.compressor.wheel_diameter_mm=42"
    seen = hevopt(
        "maps", "import", str(EXAMPLES / "compressor_map.csv"), "--kind", "compressor", "--like",
        "engine_diesel_1300", "--reference", "298.15,1.01325", "--set", diameter, "--out", "c.toml",
    )  # fmt: skip
    assert seen.status == 0, seen.err
    assert "6 speed lines" in seen.out and "down to standstill; no line is held" in seen.out
    assert "WARNING: more than" not in seen.out
    seen = hevopt(
        "maps", "import", str(EXAMPLES / "turbine_map.csv"), "--kind", "turbine", "--like", "./c.toml",
        "--set", "mean_value.rotor.inertia_kgm2=5e-6", "--out", "t.toml",
    )  # fmt: skip
    assert seen.status == 0, seen.err
    assert "share of the open area by vane position: 0: 0.2" in seen.out
    assert "WARNING: the rotor's inertia" not in seen.out
    assert (folder / "c.png").is_file() and (folder / "t.png").read_bytes().startswith(b"\x89PNG")
    text = (folder / "t.toml").read_text("utf-8")
    assert "[mean_value.turbine]" in text and "wheel_diameter_mm = 42.0" in text
    assert "inertia_kgm2 = 5e-06  # given" in text and "fitted to the map" in text
    seen = hevopt("tipin", "--set", 'engine="./t.toml"', "--json")
    assert seen.status == 0, seen.err
    for name in ("c.toml", "t.toml"):
        assert hevopt("validate", name).status == 0


def crossing_lines():
    speed, flow, ratio, efficiency = own_lines()
    swapped = np.where(speed == 100e3, 140e3, np.where(speed == 140e3, 100e3, speed))
    return swapped, flow, ratio, efficiency


def with_values(column, row, value):
    columns = own_lines()
    columns[column][row] = value
    return columns


BAD = {
    "one speed line": (own_lines((120,)), r"one speed line, at 1.2e\+05 rpm; allowed: 2 or more"),
    "few points": (own_lines(points=2), "2 points on the line at 6e.04 rpm; allowed: 3 or more"),
    "surge and choke crossed": (
        [(c := own_lines())[0], c[1], 1 / c[2] + 4, c[3]],
        "the pressure ratio is .* surge and choke are crossed; it must fall",
    ),
    "lines that cross": (crossing_lines(), r"the lines at 1e\+05 and 1.4e\+05 rpm \(25 °C\) cross, at"),
    "ratio upside down": (
        [(c := own_lines())[0], c[1], 1 / c[2], c[3]],
        "ratio 0.* allowed: above 1 to 20",
    ),
    "per cent as share": ([(c := own_lines())[0], c[1], c[2], 100 * c[3]], "efficiency 5.*allowed: above 0"),
    "shares as per cent": (
        [(c := own_lines())[0], c[1], c[2], c[3] / 100],
        r"the highest efficiency is 0.00\d+; allowed: 0.1 to 1, which is 100 %; correct the unit",
    ),
    "no flow": (with_values(1, 3, 0.0), "line 5: flow 0; allowed: above 0"),
    "an empty cell": (with_values(2, 4, np.nan), "line 6: no ratio; allowed"),
    "a wheel too small": (own_lines(), "flow number 2.* of the rim speed; allowed: 0.0001 to 2; check units"),
}  # fmt: skip


@pytest.mark.parametrize("what", BAD)
def test_a_map_that_is_none_is_one_message(folder, what):
    columns, message = BAD[what]
    write("map.csv", HEADS, *columns)
    more = {"values": {"mean_value.compressor.wheel_diameter_mm": 12.0}} if "wheel" in what else {}
    with pytest.raises(DataError, match=f"map.csv.*({message})"):
        imported("map.csv", "compressor", reference=AMBIENT, **more)


@pytest.mark.parametrize(
    ("words", "message"),
    [
        ([], "speed and flow: corrected to which temperature and pressure? Give them with --reference"),
        (["--reference", "25,1"], "--reference: 25 K; allowed: 200 to 1500 K"),
        (["--reference", "298"], "--reference '298'; needed: temperature in K and pressure in bar"),
        (["--reference", "298,1", "--rows", "speed"], "--rows is for engine and machine, not for a compressor"),
        (["--reference", "298,1", "--unit", "torque=Nm"], "torque"),
        (["--reference", "298,1", "--column", "vanes=speed"], "vanes: named with --column or --unit, and a"),
        (["--reference", "298,1", "--set", "mean_value.compressor.work=0.7"], "leave it out"),
        (["--reference", "298,1", "--set", "mean_value.rotor.inertia_kgm2=-1"], "mean_value.rotor.inertia_kgm2"),
        (["--reference", "298,1", "--like", "engine_diesel_1600_steep_nox"], "has no [mean_value] part"),
    ],
)  # fmt: skip
def test_options_that_do_not_go_together_are_one_message(hevopt, folder, words, message):
    write("map.csv", HEADS, *own_lines())
    like = [] if "--like" in words else ["--like", "engine_diesel_1300"]
    seen = hevopt("maps", "import", "map.csv", "--kind", "compressor", *like, *words)
    assert seen.status == 2
    assert message in " ".join(seen.err.replace("│", " ").split())
    assert not (folder / "map.toml").exists()


def test_a_part_without_an_engine_and_a_reference_without_a_turbocharger(hevopt, folder):
    write("map.csv", HEADS, *own_lines())
    seen = hevopt("maps", "import", "map.csv", "--kind", "turbine")
    assert seen.status == 2 and "a turbine is a part of an engine; give --like ENGINE" in seen.err
    seen = hevopt("maps", "import", "map.csv", "--kind", "engine", "--reference", "298,1")
    assert seen.status == 2 and "--reference is for compressor and turbine" in seen.err


def test_a_turbine_whose_efficiency_has_no_best_is_one_message(folder):
    speed = np.repeat([3000.0, 4000.0], 4)
    ratio = np.tile([1.2, 1.5, 2.0, 2.5], 2)
    write(
        "map.csv",
        "n [rpm/√K],flow [kg/s√K/MPa],ratio [-],eta [-]",
        speed,
        ratio,
        ratio,
        0.9 / ratio**2,
    )
    with pytest.raises(
        DataError, match=r"map.csv: highest efficiency over blade speed ratio: .*allowed"
    ):
        imported("map.csv", "turbine")
