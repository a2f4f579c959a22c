"""`hevopt tipin` and `hevopt engine full-load`, as a user runs them."""

import json

import pytest

from hevopt.files.lookup import shipped_folder


def test_a_study_prints_the_figures_and_their_definitions(hevopt):
    seen = hevopt("tipin", "--smoke", "1.1,1.4", "--egr", "0", "--integrator", "rk4")
    assert seen.status == 0, seen.err
    lines = {" ".join(line.split()[:-16]): line.split() for line in seen.out.splitlines()}
    assert "compact_1300, full pedal at 40 km/h in gear 4" in seen.out
    for label in ("as shipped", "smoke limit 1.1", "smoke limit 1.4", "EGR x 0"):
        assert seen.out.count(f"\n {label} ") == 2, lines
    for word in (
        "90 % of boost: first time after 0.3 s",
        "surge margin: least flow",
        "balances of the first case",
    ):
        assert word in seen.out
    assert "before: 1248 rpm" in seen.out


def test_as_json_it_is_the_same(hevopt):
    seen = hevopt("tipin", "--turbo-inertia", "2", "--json")
    told = json.loads(seen.out)
    base, heavy = (case["figures"] for case in told["cases"])
    assert 1.5 < heavy["boost_90_s"] / base["boost_90_s"] < 1.9
    assert 1.8 < base["ratio"][0] < 2.3
    assert told["failed"] == {}


def test_the_hybrid_helps_itself(hevopt):
    seen = hevopt("tipin", "C2", "--from", "60", "--gear", "6", "--e-boost")
    assert seen.status == 0, seen.err
    assert "limited by" in seen.out and "\n e-boost " in seen.out


def test_a_failed_case_is_said_and_makes_the_status_4(hevopt):
    seen = hevopt("tipin", "--final-drive", "1.5")
    assert seen.status == 4
    assert "final drive 1.5: 40 km/h: the gear is too high for the speed" in seen.out


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (["--step", "1"], "step 1 ms at t = 0 s is too long: gas, clutch or actuators need"),
        (["--step", "0.3"], "step 0.3 ms; allowed: 5 ms divided by a whole number"),
        (["--step", "0.25", "--integrator", "lsoda"], "--step is of rk4; lsoda chooses its own"),
        (["--gear", "9"], "gear 9 of a tip-in; this car has gears 1 to 6"),
        (["--gear", "6", "--from", "20"], "the gear is too high for the speed, the engine would turn at 3"),
        (["--gear", "1", "--from", "120"], "the gear is too low for the speed"),
        (["--from", "0"], "--from 0; allowed: 1 to 400 km/h"),
        (["--from", "nan"], "--from nan; allowed: 1 to 400 km/h"),
        (["--smoke", "lean"], "--smoke 'lean'; needed: numbers separated by commas"),
        (["--smoke", "0.2"], "--smoke 0.2; allowed: 0.8 to 10"),
        (["A", "--e-boost", "--set", "functions=[]"], "e_boost is none of this car's functions"),
        (["A", "--set", "engine.mean_value.rotor.inertia_kgm2=0"], "engine.mean_value.rotor"),
        (
            ["--set", "engine.mean_value.compressor.choke_flow=0.05"],
            "mean_value.compressor: surge and choke cross: flow numbers 0.072 and -0.076 at a rim speed of 1.8",
        ),
        (
            ["--set", "engine.mean_value.control.smoke_lambda=[9, 9]"],
            "and the engine settles to",
        ),
        (["--report", "page.txt"], "choose a name that ends in .html"),
        (["--integrator", "euler"], "'euler' is not one of"),
    ],
)  # fmt: skip
def test_bad_input_is_one_message(hevopt, words, message):
    seen = hevopt("tipin", *words)
    assert seen.status == (4 if "--e-boost" in words else 2)
    text = " ".join((seen.err + seen.out).replace("│", " ").split())
    assert message in text
    assert "Traceback" not in text


def test_full_load_is_printed_and_drawn(hevopt, tmp_path):
    seen = hevopt("engine", "full-load", "engine_diesel_1300", "--plot", "curve.png")
    assert seen.status == 0, seen.err
    rows = {
        line.split()[0]: line.split()
        for line in seen.out.splitlines()
        if line[:6].strip().isdigit()
    }
    assert float(rows["2000"][1]) == pytest.approx(200, rel=0.01)
    assert (tmp_path / "curve.png").read_bytes().startswith(b"\x89PNG")


def test_an_engine_without_the_part_and_a_plot_that_is_none_are_one_message(hevopt):
    seen = hevopt("engine", "full-load", "engine_diesel_1600_steep_nox")
    assert seen.status == 2 and "has no [mean_value] part, which turbo-lag needs" in seen.err
    seen = hevopt("engine", "full-load", "--plot", "curve.pdf")
    assert seen.status == 2 and "choose a name that ends in .png" in seen.err


def test_another_size_of_the_engine_lags_as_its_rotor_says(hevopt, tmp_path):
    text = (shipped_folder("architectures") / "tipin" / "compact_1300.toml").read_text()
    (tmp_path / "big.toml").write_text(text.replace('compact_1300"\n', 'big"\n', 1))
    half = hevopt("tipin", "big.toml", "--set", "engine.scale.displacement=1.2", "--json")
    own = hevopt("tipin", "big.toml", "--json")
    one, two = (json.loads(seen.out)["cases"][0]["figures"] for seen in (own, half))
    assert two["accel_mps2"][0] > 1.1 * one["accel_mps2"][0]


def test_an_inertia_that_no_file_gives_is_scaled_and_its_uncertainty_said(hevopt, tmp_path):
    text = (shipped_folder("architectures") / "components" / "engine_diesel_1300.toml").read_text()
    lines = [line for line in text.splitlines() if not line.startswith("inertia_kgm2 = 6.0e-6")]
    (tmp_path / "unweighed.toml").write_text("\n".join(lines))
    seen = hevopt("tipin", "--set", 'engine="./unweighed.toml"', "--report", "page.html")
    assert seen.status == 0, seen.err
    said = "6.2e-06 kg m² by its size, 5.4e-06 and 7.1e-06 by the two known rotors; --turbo-inertia 0.87,1.15"
    assert said in " ".join(seen.out.split())
    assert said in (tmp_path / "page.html").read_text("utf-8")
    assert "The file gives no inertia" not in hevopt("tipin").out
