"""What `hevopt maps import --kind gearbox` makes of losses that are known, and what a car makes of its map."""

from pathlib import Path

import numpy as np
import pytest
from map_bench import component, write
from numpy.testing import assert_allclose

from hevopt import DataError, build_problem, import_map, load_cycle, simulate
from hevopt.car_files.load import load_architecture
from hevopt.measured.gearbox.component import ImportedGearbox

EXAMPLES = Path(__file__).parents[3] / "examples"
RATIOS, FINAL = [4.0, 2.0, 1.0], 3.5
GIVEN = {
    "ratios": RATIOS, "final_drive_ratio": FINAL,
    "shift_speeds": {"up_kmh": [15, 35], "down_kmh": [10, 28]},
}  # fmt: skip
HEADS = "gear,input speed [rad/s],input torque [Nm],torque loss [Nm]"
SPEEDS, TORQUES = (50.0, 150.0, 400.0, 700.0), (-150.0, -60.0, -10.0, 0.0, 10.0, 60.0, 200.0, 350.0)


@pytest.fixture
def folder(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    return tmp_path


def loss_nm(gear, speed, torque):
    """Linear in speed and in torque of either sign, so that a grid holds it exactly."""
    return 0.5 + 0.2 * gear + 2e-3 * speed + 0.03 * np.abs(torque)


def bench():
    """(point, 4) gear, input speed, input torque and torque lost."""
    gear, speed, torque = (
        part.ravel() for part in np.meshgrid([1.0, 2.0, 3.0], SPEEDS, TORQUES, indexing="ij")
    )
    return np.column_stack([gear, speed, torque, loss_nm(gear, speed, torque)])


def imported(file, **more) -> ImportedGearbox:
    found = import_map(file, "gearbox", **{"values": GIVEN, **more}).imported
    assert isinstance(found, ImportedGearbox)
    return found


def losses(file, **more) -> np.ndarray:
    """(gear, speed, torque) mapped at the bench's speeds, over torques inside."""
    grids = imported(file, **more).grids
    inside = np.array([-100.0, -5.0, 5.0, 100.0, 300.0])
    return np.array([
        [np.interp(inside, g.data.torque_nm, row) for row in g.data.loss_nm] for g in grids
    ])  # fmt: skip


def test_losses_in_any_shape_give_one_map(folder):
    """Torque or power lost, efficiency at the input or the output: the loss that they were made from."""
    gear, speed, torque, lost = bench().T
    ratio = FINAL * np.array(RATIOS)[gear.astype(int) - 1]
    out, out_speed = ratio * (torque - lost), speed / ratio
    with np.errstate(divide="ignore", invalid="ignore"):
        eta = np.where(
            torque > 0, 1 - lost / torque, np.where(torque < 0, torque / (torque - lost), np.nan)
        )
    some = torque != 0
    write("loss.csv", HEADS, gear, speed, torque, lost)
    write(
        "power.csv",
        "gear,n_in [rpm],t_in [Nm],power loss [kW]",
        gear,
        speed * 30 / np.pi,
        torque,
        lost * speed / 1e3,
    )
    write(
        "eta.csv",
        "gear,speed [rad/s],torque [Nm],eta [%]",
        gear[some],
        speed[some],
        torque[some],
        100 * eta[some],
    )
    write(
        "wheel.csv",
        "gear,output_speed_radps,output_torque_nm,eta [-]",
        *(v[some] for v in (gear, out_speed, out, eta)),
    )
    whole = losses("loss.csv")
    at = np.array([-100.0, -5.0, 5.0, 100.0, 300.0])
    for g in (1, 2, 3):
        for i, w in enumerate(SPEEDS):
            assert_allclose(whole[g - 1, i], loss_nm(g, w, at), rtol=1e-6)
    assert_allclose(losses("power.csv"), whole, rtol=1e-6)
    # Without a point at torque 0 the map is straight between the lowest of either sign, where the bench is not.
    for shape, more in (("eta.csv", {"side": "input"}), ("wheel.csv", {})):
        away = [0, 3, 4]
        assert_allclose(losses(shape, **more)[..., away], whole[..., away], rtol=2e-3)


def car_with(gearbox: str, name: str = "A"):
    return load_architecture(name, {"gearbox": gearbox})


def flat_map(efficiency: float) -> str:
    """A gearbox file whose map is one efficiency of both directions, that of A's own."""
    rows = ["name = 'flat'", "final_drive_ratio = 3.40", "ratios = [4.066, 2.219, 1.402, 1.026, 0.813, 0.676]",
            "shift_gap_s = 0.5", "[shift_speeds]", "up_kmh = [15, 35, 50, 70, 100]",
            "down_kmh = [10, 28, 42, 60, 88]"]  # fmt: skip
    torque = [-400.0, 0.0, 400.0]
    lost = [400 * (1 / efficiency - 1), 0.0, 400 * (1 - efficiency)]
    for _ in range(6):
        rows += [
            "[[loss_map]]",
            "speed_rpm = [0, 8000]",
            f"torque_nm = {torque}",
            f"loss_nm = [{lost}, {lost}]",
        ]
    Path("flat.toml").write_text("\n".join(rows) + "\n")
    return "./flat.toml"


@pytest.mark.parametrize("name", ["A", "C2", "E"])
def test_a_map_of_one_efficiency_is_that_efficiency(folder, beginnings, name):
    """Row by row of the table: the closed form of the map against the directions of power."""
    cycle = load_cycle(beginnings / "nedc.csv")
    with_map = build_problem(car_with(flat_map(0.95), name), cycle).table
    plain = build_problem(load_architecture(name), cycle).table
    usable = plain.reject == 0
    assert ((with_map.reject == 0) == usable).all()
    assert_allclose(with_map.fuel_kg[usable], plain.fuel_kg[usable], rtol=1e-9, atol=1e-12)
    assert_allclose(
        with_map.battery_power_w[usable], plain.battery_power_w[usable], rtol=1e-9, atol=1e-5
    )


def test_a_car_burns_what_its_gearbox_loses_point_by_point(hevopt, folder, beginnings):
    """The Insight's gearbox: engine torque of A at each step from wheels and map, worked out apart."""
    seen = hevopt(
        "maps", "import", str(EXAMPLES / "insight_gearbox.csv"), "--kind", "gearbox", "--out", "box.toml",
        "--set", "ratios=[3.46, 1.75, 1.10, 0.86, 0.71]", "--set", "final_drive_ratio=3.21",
        "--set", "shift_speeds={up_kmh=[15, 35, 50, 70], down_kmh=[10, 28, 42, 60]}",
    )  # fmt: skip
    assert seen.status == 0, seen.err
    assert "left out:" in seen.out and "points lie" in seen.out and (folder / "box.png").is_file()
    cycle = load_cycle(beginnings / "udds.csv")
    car = car_with("./box.toml")
    problem = build_problem(car, cycle)
    table = problem.table
    control = np.argmin(np.where(table.reject == 0, table.fuel_kg, np.inf), axis=1)
    flows = simulate(problem, control).flows
    assert max(np.abs(r).max() for r in simulate(problem, control).residuals.values()) < 1e-6
    signals, maps = table.signals, component("box.toml")["loss_map"]
    radius, moving = car.vehicle.tyre_radius_m, table.signals.speed_mps > 0
    closed = (
        moving & (signals.gear > 0) & (flows["clutch_loss_w"] == 0) & (flows["wheel_power_w"] > 0)
    )
    assert closed.sum() > 10
    for k in np.flatnonzero(closed):
        gear = int(signals.gear[k])
        ratio = [3.46, 1.75, 1.10, 0.86, 0.71][gear - 1] * 3.21
        speed = signals.speed_mps[k] / radius * ratio
        own = maps[gear - 1]
        at = np.array(
            [
                np.interp(speed * 30 / np.pi, own["speed_rpm"], c)
                for c in np.transpose(own["loss_nm"])
            ]
        )
        lost = flows["gearbox_loss_w"][k] / speed
        entering = flows["wheel_power_w"][k] / speed + lost
        assert lost == pytest.approx(np.interp(entering, own["torque_nm"], at), rel=1e-5, abs=1e-5)
        assert entering == pytest.approx(_engine_side_nm(flows, k, speed), rel=1e-6, abs=1e-6)


def _engine_side_nm(flows, k, speed) -> float:
    """What reaches the gearbox's input: engine and belt machine less what their own inertia takes."""
    machine_w = flows["machine_power_w"][k] - flows["machine_inertia_w"][k]
    engine_w = flows["engine_torque_nm"][k] * flows["engine_speed_radps"][k]
    return (engine_w - flows["engine_inertia_w"][k] + machine_w) / speed


def test_what_lies_outside_the_map_is_rejected_and_said(hevopt, folder, beginnings):
    path = Path(flat_map(0.95)[2:])
    path.write_text(path.read_text().replace("-400.0, 0.0, 400.0", "-40.0, 0.0, 40.0"))
    seen = hevopt(
        "run",
        "A",
        "--cycle",
        str(beginnings / "udds.csv"),
        "--set",
        'gearbox="./flat.toml"',
    )
    assert seen.status == 3 and "outside the gearbox map" in seen.err


def test_what_cannot_count_with_a_map_says_so(hevopt, folder):
    box = flat_map(0.95)
    seen = hevopt("drive", "E", "--set", f'gearbox="{box}"')
    assert seen.status == 2 and "loss_map is of more than one gearbox" in seen.err, seen.err
    seen = hevopt("tipin", "compact_1300", "--set", f'gearbox="{box}"')
    assert seen.status == 2 and "gearbox has a loss_map" in seen.err, seen.err


@pytest.mark.parametrize(
    ("heads", "change", "more", "words"),
    [
        ("gear,speed [rad/s],torque [Nm],loss [Nm]", None, {}, "do not tell which side"),
        ("gear,input speed [rad/s],output torque [Nm],loss [Nm]", None, {}, "two sides of the gearbox"),
        (HEADS, None, {"side": "output"}, "own names say input"),
        (HEADS, None, {"side": "left"}, "allowed: input, output"),
        (HEADS.replace("gear", "x"), None, {}, "no column of gear"),
        (HEADS.replace("torque loss", "x"), None, {}, "neither of efficiency and loss"),
        (HEADS.replace("torque loss [Nm]", "eta [-]"), None, {}, r"efficiency .*allowed: 0 to 1"),
        (HEADS, (0, 0, 4.0), {}, "line 2: gear 4; allowed: 1 to 3"),
        (HEADS, (0, 1, 0.0), {}, "line 2: speed 0; allowed: above 0"),
        (HEADS, (0, 3, -1.0), {}, "line 2: loss -1; allowed: 0 or more"),
        (HEADS, (6, 3, 300.0), {}, "rises by more than the torque itself"),
        (HEADS, None, {"values": GIVEN | {"ratios": [4, 3, 2, 1]}}, "shift_speeds need 3"),
        (HEADS, None, {"values": GIVEN | {"efficiency": 0.9}}, "what the import writes"),
        (HEADS, None, {"values": {}}, "needs ratios, final_drive_ratio, shift_speeds"),
        (HEADS, None, {"start_soc": 0.5}, "--start-soc is for battery, not for a gearbox"),
    ],
)  # fmt: skip
def test_a_table_that_cannot_be_read_is_one_message(folder, heads, change, more, words):
    rows = bench()
    if change is not None:
        rows[change[:2]] = change[2]
    write("box.csv", heads, *rows.T)
    with pytest.raises(DataError, match=words):
        imported("box.csv", **more)
