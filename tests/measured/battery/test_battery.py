"""What `hevopt maps import --kind battery` makes of a cell's tests, against the formulas behind them."""

from pathlib import Path

import numpy as np
import pytest
from map_bench import component, write
from numpy.testing import assert_allclose

from hevopt import DataError, import_map, load_architecture
from hevopt.car_files.load import load_architecture as load_file
from hevopt.measured.battery.component import ImportedBattery

EXAMPLES = Path(__file__).parents[3] / "examples"
CAPACITY_AH, TAU_S, PULSE_S = 6.0, 3.0, 10.0
WINDOW = {"cells_in_series": 10, "soc": {"start": 0.5, "min": 0.3, "max": 0.8}}
GIVEN = WINDOW | {"capacity_ah": CAPACITY_AH}
HEADS = "t [s],i [A],u [V]"
AFTER = 1 - np.exp(-PULSE_S / TAU_S)


@pytest.fixture
def folder(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    return tmp_path


def ocv(x):
    return 3.2 + 0.6 * x


def ohmic(x, i):
    return np.where(i > 0, 0.014 - 0.004 * x, 0.009 + 0.001 * x)


def slow(i):
    """Rct + Rd once all of it is there."""
    return np.where(i > 0, 0.006, 0.004)


def driven(parts, soc=0.95, colder=1.0):
    """(row, 4) time, current (> 0 discharges), voltage and soc of a cell with R0 and one RC, every current in turn.

    parts: (current, seconds, seconds a sample); a row just before and just after every step
    """
    rows, time, lag = [(0.0, 0.0, ocv(soc), soc)], 0.0, 0.0
    for i, seconds, every in parts:
        rows.append((time, i, ocv(soc) - colder * ohmic(soc, i) * i - lag, soc))
        for _ in range(round(seconds / every)):
            fade = np.exp(-every / TAU_S)
            lag = lag * fade + (1 - fade) * colder * slow(i) * i
            time, soc = time + every, soc - i * every / 3600 / CAPACITY_AH
            rows.append((time, i, ocv(soc) - colder * ohmic(soc, i) * i - lag, soc))
    return np.array(rows)


def pulses(levels=8, **more):
    """Ten seconds out, ten in, at every tenth of charge."""
    part = [
        (0, 90, 3),
        (18, PULSE_S, 0.5),
        (0, 90, 3),
        (-12, PULSE_S, 0.5),
        (0, 90, 3),
        (6, 330, 10),
    ]
    return driven([*part * levels, (0, 90, 3)], **more)


def imported(file, **more) -> ImportedBattery:
    found = import_map(file, "battery", **more).imported
    assert isinstance(found, ImportedBattery)
    return found


def test_pulses_of_a_known_cell_give_its_curves_and_tell_r0_from_the_rest(folder):
    time, current, voltage, _ = pulses().T
    write("cell.csv", HEADS, time, current, voltage)
    found = imported("cell.csv", start_soc=0.95, values=GIVEN)
    fit = found.curves[0].fit
    told = fit.told_discharge & fit.told_charge
    assert told.sum() >= 8
    assert_allclose(fit.open_circuit_v, ocv(fit.soc), atol=2e-5)
    for all_ohm, alone, sign in (
        (fit.discharge_ohm, fit.ohmic_discharge_ohm, 1), (fit.charge_ohm, fit.ohmic_charge_ohm, -1),
    ):  # fmt: skip
        known = ohmic(fit.soc, sign)
        assert_allclose(alone[told], known[told], rtol=2e-2)
        assert_allclose(all_ohm[told], (known + AFTER * slow(sign))[told], rtol=1e-2)
    assert found.file.discharge_ohm[3] == pytest.approx(fit.discharge_ohm[3], rel=1e-5)
    said = "\n".join(found.said)
    assert "16 pulses of 10 s" in said and "R0 10" in said and "Rct + Rd" in said
    # An independent look at what is left: the model's own step error, Rct + Rd before it has come, at 18 A.
    assert np.abs(fit.off_v).max() == pytest.approx(18 * AFTER * 0.006, rel=0.05)


def test_units_signs_and_a_column_of_charge_make_no_difference(folder):
    time, current, voltage, soc = pulses().T
    write("one.csv", HEADS, time, current, voltage)
    write(
        "two.csv",
        "test time [min],I [mA],U [mV],SOC [%]",
        time / 60,
        -1e3 * current,
        1e3 * voltage,
        100 * soc,
    )
    write("three.csv", "time;s,i;A".replace(";", " in ") + ",u in V,Ah [Ah]", time, -current, voltage,
          CAPACITY_AH * (soc - 0.95))  # fmt: skip
    one = imported("one.csv", start_soc=0.95, values=GIVEN)
    two = imported("two.csv", values=WINDOW)
    three = imported("three.csv", start_soc=0.95, values=GIVEN)
    assert two.file.capacity_ah == pytest.approx(CAPACITY_AH, rel=2e-3)
    assert "below 0 discharges" in "\n".join(two.notes)
    for other in (two, three):
        for key in ("curve_soc", "open_circuit_v", "discharge_ohm", "charge_ohm"):
            assert_allclose(getattr(other.file, key), getattr(one.file, key), rtol=2e-3)


def test_constant_currents_tell_voltage_and_resistance_apart_and_what_is_assumed(folder):
    """Two discharges and no rest: R is that of the settled load, and that of charging is assumed."""
    slowly, quickly = driven([(1.5, 3600 * 3, 60)]), driven([(9, 3600 * 0.5, 20)])
    quickly[:, 0] += slowly[-1, 0] + 3600
    time, current, voltage, soc = np.concatenate([slowly[1:], quickly[1:]]).T
    write("cell.csv", f"{HEADS},soc [-]", time, current, voltage, soc)
    found = imported("cell.csv", values=GIVEN)
    curves, fit = found.curves[0], found.curves[0].fit
    assert_allclose(curves.open_circuit_v, ocv(fit.soc), atol=1e-3)
    assert_allclose(curves.discharge_ohm, ohmic(fit.soc, 1) + slow(1), rtol=0.02)
    assert_allclose(curves.charge_ohm, curves.discharge_ohm)
    said = "\n".join(found.said)
    assert (
        "charging: no load in this direction; ASSUMED" in said and "not told from Rct + Rd" in said
    )
    write("one.csv", f"{HEADS},soc [-]", *slowly[1:].T)
    with pytest.raises(
        DataError, match=r"one current only.*add rests, or a run at another current"
    ):
        imported("one.csv", values=GIVEN)


def test_each_temperature_has_curves_of_its_own(folder):
    warm, cold = pulses(), pulses(colder=2.0)
    cold[:, 0] += warm[-1, 0] + 3600
    rows = np.concatenate([warm, cold])
    kelvin = np.repeat([298.15, 273.15], [len(warm), len(cold)])
    write("cell.csv", f"{HEADS},soc [-],cell temperature [K]", *rows.T, kelvin)
    found = imported("cell.csv", values=GIVEN)
    assert [c.temperature_c for c in found.curves] == pytest.approx([0.0, 25.0])
    assert "the component is that of 25 °C" in "\n".join(found.notes)
    frozen = imported("cell.csv", values=GIVEN, temperature_c=1.0)
    assert_allclose(frozen.file.discharge_ohm, 2 * np.array(found.file.discharge_ohm), rtol=0.02)
    with pytest.raises(DataError, match="--temperature 60: measured at 0, 25 °C"):
        imported("cell.csv", values=GIVEN, temperature_c=60.0)


def test_the_prius_pack_as_published_curves_is_the_shipped_battery(hevopt, folder):
    seen = hevopt(
        "maps", "import", str(EXAMPLES / "nimh_module.csv"), "--kind", "battery", "--like", "battery_nimh_40",
        "--out", "pack.toml",
    )  # fmt: skip
    assert seen.status == 0, seen.err
    assert "as the table gives them, nothing fitted" in seen.out
    assert "from battery_nimh_40: cells_in_series, capacity_ah" in seen.out
    assert (folder / "pack.png").read_bytes().startswith(b"\x89PNG")
    ours = load_architecture("prius_1998").battery
    pack = load_file("prius_1998", {"battery": "./pack.toml"}).battery
    for curve in ("soc", "open_circuit_v", "discharge_ohm", "charge_ohm"):
        assert_allclose(getattr(pack, curve), getattr(ours, curve), rtol=1e-6)
    assert component("pack.toml")["soc"] == {"start": 0.6, "min": 0.45, "max": 0.75}


def test_the_example_of_pulses_is_imported_with_its_picture(hevopt, folder):
    seen = hevopt(
        "maps", "import", str(EXAMPLES / "battery_pulses.csv"), "--kind", "battery", "--like", "battery_nimh_40",
        "--start-soc", "0.9", "--set", "capacity_ah=6", "--out", "pack.toml",
    )  # fmt: skip
    assert seen.status == 0, seen.err
    assert "Rct + Rd" in seen.out and (folder / "pack.png").is_file()
    # The stand-in was made from the shipped pack's curves.
    made, of = component("pack.toml"), load_architecture("prius_1998").battery
    assert_allclose(
        made["open_circuit_v"],
        np.interp(made["curve_soc"], of.soc, of.open_circuit_v / 40),
        atol=3e-3,
    )
    inner = slice(1, -1)
    assert_allclose(
        made["discharge_ohm"][inner],
        np.interp(made["curve_soc"], of.soc, of.discharge_ohm / 40)[inner],
        rtol=0.05,
    )


def spoilt(what):
    """Header and columns of a good test with one fault."""
    time, current, voltage, soc = pulses(levels=3).T.copy()
    if what == "back":
        time[7] = time[5] - 1
    elif what == "none":
        current[:] = 0
    elif what == "gap":
        voltage[4] = np.nan
    elif what == "still":
        soc[:] = 0.6
    elif what == "against":
        soc = 1.4 - soc
    elif what == "resets":
        soc = np.where(np.arange(len(soc)) % 40 == 0, 0.0, soc)
    return time, current, voltage, soc


@pytest.mark.parametrize(
    ("what", "heads", "more", "words"),
    [
        ("", "t [s],u [V],x [A],soc [-]", {}, "no column of current found"),
        ("", "t [s],i [A],u [V],x [-]", {}, "no column of soc found; name it .* --start-soc"),
        ("", "t [s],i,u [V],soc [-]", {}, "i.*unit"),
        ("", f"{HEADS},soc [-]", {"start_soc": 0.9}, "both a column of soc and --start-soc"),
        ("", f"{HEADS},x [-]", {"start_soc": 0.2}, "beyond 0 to 1; check --start-soc"),
        ("", f"{HEADS},x [-]", {"start_soc": 1.2}, "--start-soc 1.2; allowed"),
        ("", f"{HEADS},soc [-]", {"temperature_c": 20.0}, "no column of it"),
        ("", f"{HEADS},soc [-]", {"rows": "speed"}, "--rows is for engine and machine, not for a battery"),
        ("", f"{HEADS},soc [-]", {"values": {"capacity_ah": 6}}, "needs cells_in_series, soc.start"),
        ("", f"{HEADS},soc [-]", {"values": GIVEN | {"charge_ohm": 1}}, "what the import writes"),
        ("", f"{HEADS},soc [-]", {"values": GIVEN | {"soc.min": 0.05}}, "test covers states of charge"),
        ("", f"{HEADS},soc [-]", {"values": GIVEN | {"capacity_ah": "six"}}, "a number above 0"),
        ("back", f"{HEADS},soc [-]", {}, "line 9: time goes back"),
        ("none", f"{HEADS},soc [-]", {}, "no current flows"),
        ("gap", f"{HEADS},soc [-]", {}, "line 6: no voltage"),
        ("still", f"{HEADS},soc [-]", {}, "curves over charge need"),
        ("against", f"{HEADS},soc [-]", {}, "that of the other"),
        ("resets", f"{HEADS},ah [Ah]", {"start_soc": 0.9}, "starts anew at every step"),
    ],
)  # fmt: skip
def test_a_test_that_cannot_be_read_is_one_message(folder, what, heads, more, words):
    write("cell.csv", heads, *spoilt(what))
    with pytest.raises(DataError, match=words):
        imported(
            "cell.csv",
            **{"values": GIVEN | {"soc": {"start": 0.8, "min": 0.75, "max": 0.9}}, **more},
        )


@pytest.mark.parametrize(
    ("row", "words"),
    [
        ("0.5,7.6,0.02,0.02", "line 4: soc 0.5.*again"),
        ("0.9,7.1,0.02,0.02", "line 4: soc 0.9.*below that at less charge"),
        ("0.9,7.9,-0.02,0.02", "line 4: discharge -0.02; allowed: 0 ohm"),
        ("90,7.9,0.02,0.02", "line 4: soc 90; allowed: 0 to 1"),
    ],
)
def test_curves_that_no_battery_has_are_refused_with_their_line(folder, row, words):
    head = "soc [-],ocv [V],resistance_discharge [ohm],resistance_charge [ohm]"
    Path("c.csv").write_text(
        "\n".join([head, "0.1,7.4,0.03,0.02", "0.5,7.5,0.02,0.02", row]) + "\n"
    )
    with pytest.raises(DataError, match=words):
        imported("c.csv", values=GIVEN)
