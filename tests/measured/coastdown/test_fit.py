"""`hevopt coastdown`: C0, C1, C2 from runs in both directions, against an integrator that shares no code."""

import re
import tomllib
from pathlib import Path

import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy.integrate import solve_ivp
from scipy.stats import binom

from hevopt import DataError, load_architecture
from hevopt.car.vehicle import Vehicle
from hevopt.files.lookup import shipped_folder
from hevopt.measured.coastdown.fit import Run, fit_road_load, speed_after

SHIPPED = shipped_folder("architectures")
TRUTH = np.array([110.0, 0.9, 0.41])
MASS_KG, ROTATING_KG = 1300.0, 50.0
MASS = ("--mass-kg", "1300", "--rotating-mass-kg", "50")
GRAVITY = 9.80665


def coast(
    rng,
    count=6,
    *,
    wind=0.0,
    grade=0.0,
    noise=0.0,
    gust=0.0,
    scatter=0.0,
    step_s=0.5,
    speeds=((34.0, 4.0),),
) -> list[Run]:
    """Runs in turn in either direction, by SciPy: steady wind and slope; gusts and rolling differ by run."""
    runs = []
    for k in range(count):
        d, (start, end) = (1, -1)[k % 2], speeds[k // 2 % len(speeds)]
        rolling, phase = TRUTH[0] * (1 + scatter * rng.normal()), rng.uniform(0, 2 * np.pi)
        blowing = wind + gust * rng.normal()

        def slower(t, v, d=d, rolling=rolling, phase=phase, blowing=blowing):
            air = v + d * (blowing + gust * np.sin(0.2 * t + phase))
            force = rolling + TRUTH[1] * v + TRUTH[2] * air * np.abs(air)
            return -(force + d * MASS_KG * GRAVITY * grade) / (MASS_KG + ROTATING_KG)

        def at_end(_, v, end=end):
            return v[0] - end

        at_end.terminal = True
        found = solve_ivp(
            slower, (0, 1000), [start], rtol=1e-8, atol=1e-8, events=at_end, dense_output=True
        )
        t = np.arange(0, found.t[-1], step_s)
        v = found.sol(t)[0] + noise * rng.normal(size=len(t))
        runs.append(Run(str(k + 1), d, t, v, "made up"))
    return runs


def written(path: str, runs: list[Run], head="run,direction,time_s,speed_kmh", columns=4) -> None:
    rows = [
        ",".join(f"{x:.10g}" for x in (int(r.label), r.direction, t, v * 3.6)[-columns:])
        for r in runs
        for t, v in zip(r.time_s, r.speed_mps, strict=True)
    ]
    Path(path).write_text("\n".join([head, *rows]) + "\n")


@pytest.mark.parametrize(
    "force",
    [(110, 0.9, 0.41), (110, 0, 0), (110, 5, 0), (0, 0, 0.41), (-300, 0, 0.4), (50, 30, 0.1), (110, 13.433, 0.41)]
)  # fmt: skip
def test_the_closed_solution_is_that_of_an_integrator(force):
    a, b, c = force
    t = np.linspace(0, 60, 61)
    found = solve_ivp(
        lambda _, v: -(a + b * v + c * v**2) / 1350,
        (0, 60),
        [35.0],
        t_eval=t,
        rtol=1e-11,
        atol=1e-11,
    )
    ours = speed_after(t, 35.0, np.array(force, dtype=float), 1350.0)
    assert_allclose(ours.real, found.y[0], rtol=1e-8)
    assert_allclose(ours.imag, 0, atol=1e-12)


def test_without_noise_coefficients_wind_and_slope_come_back():
    fit = fit_road_load(
        coast(np.random.default_rng(1), 4, wind=3.0, grade=0.004), MASS_KG + ROTATING_KG
    )
    assert_allclose(fit.coefficients, TRUTH, rtol=2e-6)
    assert fit.wind_mps == pytest.approx(3.0, rel=1e-5)
    assert fit.slope_n == pytest.approx(MASS_KG * GRAVITY * 0.004, rel=1e-5)
    force, half = fit.force_n(np.array([0.0, 20.0]))
    assert_allclose(force, [110, 110 + 0.9 * 20 + 0.41 * 400], rtol=1e-5)
    assert (half < 1e-3).all()


def test_a_wind_left_in_the_mean_would_be_an_error_of_c0():
    runs = coast(np.random.default_rng(1), 4, wind=5.0, speeds=((34.0, 6.0),))
    fit = fit_road_load(runs, MASS_KG + ROTATING_KG)
    assert_allclose(fit.coefficients[0], TRUTH[0], atol=1e-3)
    own = [
        np.polynomial.Polynomial.fit(r.speed_mps[1:-1], _force(r), 2).convert().coef for r in runs
    ]
    assert np.mean(own, axis=0)[0] - TRUTH[0] == pytest.approx(0.41 * 25, rel=0.05)


def _force(run: Run) -> np.ndarray:
    """Force between samples without noise, by differences."""
    t, v = run.time_s, run.speed_mps
    return -(MASS_KG + ROTATING_KG) * (v[2:] - v[:-2]) / (t[2:] - t[:-2])


def test_runs_split_into_a_fast_and_a_slow_part_fit_as_whole_ones():
    speeds = ((34.0, 16.0), (18.0, 4.0))
    fit = fit_road_load(
        coast(np.random.default_rng(2), 8, grade=0.003, speeds=speeds), MASS_KG + ROTATING_KG
    )
    assert_allclose(fit.coefficients, TRUTH, rtol=1e-4)


def covered(trials: int, runs: int, seed: int) -> np.ndarray:
    """(3,) in how many trials the interval of each coefficient holds the truth."""
    rng, hits = np.random.default_rng(seed), np.zeros(3, dtype=int)
    for _ in range(trials):
        made = coast(
            rng, runs, wind=2.0, grade=0.003, noise=0.1, gust=0.4, scatter=0.02, step_s=1.0
        )
        fit = fit_road_load(made, MASS_KG + ROTATING_KG)
        hits += np.abs(fit.coefficients - TRUTH) <= fit.half_width()
    return hits


def assert_about_95_percent(hits: np.ndarray, trials: int) -> None:
    """Not so few, nor so many, that 95 % would give as much in one of a thousand cases."""
    low, high = binom.ppf([5e-4, 1 - 5e-4], trials, 0.95)
    assert (hits >= low).all() and (hits <= high).all(), hits / trials


def test_the_intervals_hold_the_truth_about_as_often_as_they_say():
    assert_about_95_percent(covered(60, 6, seed=5), 60)


@pytest.mark.long
@pytest.mark.parametrize("runs", [4, 6, 10])
def test_the_intervals_hold_the_truth_in_95_percent_of_many_trials(runs):
    hits = covered(1000, runs, seed=runs)
    # With two runs a direction, the degrees of freedom come out low, and the intervals a little wide.
    assert_about_95_percent(np.minimum(hits, 971) if runs == 4 else hits, 1000)


def test_noise_of_samples_alone_would_promise_too_much():
    """The interval is that of runs which differ, not of thousands of samples."""
    rng = np.random.default_rng(7)
    narrow = fit_road_load(coast(rng, 6, noise=0.02), MASS_KG + ROTATING_KG).half_width()
    wide = fit_road_load(
        coast(rng, 6, noise=0.02, scatter=0.05), MASS_KG + ROTATING_KG
    ).half_width()
    assert wide[0] > 3 * narrow[0]


def test_from_a_log_to_a_car_that_drives(hevopt):
    runs = coast(np.random.default_rng(3), 6, wind=1.5, grade=0.002, noise=0.05, scatter=0.01)
    written("c.csv", runs)
    seen = hevopt(
        "coastdown", "c.csv", *MASS, "--like", "car_compact", "--out", "car.toml", "--plot", "c.png"
    )
    assert seen.status == 0, seen
    for said in ("6 runs, 3 and 3 per direction; mass 1300 kg, rotating parts 50 kg", "C0 = ", "95 % confidence",
                 "at  80 km/h", "head wind +1.", "slope +0.2", "speed: speed_kmh in km/h"):  # fmt: skip
        assert said in seen.out, said
    assert Path("c.png").read_bytes().startswith(b"\x89PNG")
    contents = tomllib.loads(Path("car.toml").read_text())
    assert contents["mass_kg"] == contents["road_load"]["coastdown_mass_kg"] == 1300
    for said in (
        "becomes the car's mass without hybrid parts",
        "C0 is taken as rolling resistance",
    ):
        assert said in seen.out and said in Path("car.toml").read_text()
    assert contents["wheel_inertia_kgm2"] == pytest.approx(50 * 0.3132**2)
    found = [
        contents["road_load"][k]
        for k in ("coastdown_c0_n", "coastdown_c1_nspm", "coastdown_c2_ns2pm2")
    ]
    assert_allclose(found, TRUTH, rtol=0.3)
    text = (
        (SHIPPED / "A.toml")
        .read_text(encoding="utf-8")
        .replace('"car_compact"', f'"{Path("car.toml").resolve()}"')
    )
    for part in (
        "engine_diesel_1600",
        "gearbox_manual_6",
        "machine_alternator",
        "battery_12v_60ah",
    ):
        text = text.replace(f'"{part}"', f'"{SHIPPED}/components/{part}.toml"')
    Path("a.toml").write_text(text)
    vehicle: Vehicle = load_architecture("./a.toml").vehicle
    assert vehicle.mass_kg == 1300
    assert hevopt("run", "./a.toml", "--strategy", "baseline").status == 0


def test_several_files_and_directions_by_option(hevopt):
    runs = coast(np.random.default_rng(3), 4, noise=0.05)
    for run in runs:
        written(f"r{run.label}.csv", [run], "time [s],v [km/h]", 2)
    files = [f"r{run.label}.csv" for run in runs]
    whole = hevopt("coastdown", *files, *MASS, "--directions", "+,-,+,-")
    written("c.csv", runs)
    assert whole.status == 0 and "C0 = " in whole.out
    results = [
        text.split("4 runs, ")[1] for text in (whole.out, hevopt("coastdown", "c.csv", *MASS).out)
    ]
    assert results[0].split("\nWARNING")[0] == results[1].split("\nWARNING")[0]
    assert "4 runs only" in whole.out
    wrong = hevopt("coastdown", *files, *MASS, "--directions", "+,-")
    assert wrong.status == 2 and "names 2 runs, the files hold 4" in wrong.err
    none = hevopt("coastdown", *files, *MASS)
    assert none.status == 2 and "no column of direction for the 4 runs found" in none.err


def test_time_that_goes_back_is_a_new_run_or_a_fault(hevopt):
    runs = coast(np.random.default_rng(3), 6, noise=0.05)
    written("c.csv", runs)
    text = Path("c.csv").read_text().replace("3,1,50,", "3,1,5,")
    Path("c.csv").write_text(text)
    seen = hevopt("coastdown", "c.csv", *MASS)
    assert seen.status == 2 and "run 3: time 5 s follows 49.5 s" in seen.err
    for run in runs:
        written(f"r{run.label}.csv", [run], "time [s],v [km/h]", 2)
    lines = [Path(f"r{k}.csv").read_text().splitlines() for k in range(1, 7)]
    Path("log.csv").write_text(
        "\n".join([lines[0][0], *(row for part in lines for row in part[1:])]) + "\n"
    )
    seen = hevopt("coastdown", "log.csv", *MASS, "--directions", "+,-,+,-,+,-")
    assert seen.status == 0 and "6 runs, 3 and 3 per direction" in seen.out


def test_an_interval_that_says_nothing_is_said(hevopt):
    runs = coast(np.random.default_rng(3), 6, noise=0.1, scatter=0.02, speeds=((34.0, 26.0),))
    written("c.csv", runs)
    seen = hevopt("coastdown", "c.csv", *MASS)
    assert seen.status == 0
    assert (
        "WARNING: C0" in seen.out
        and "do not separate the coefficients (condition number" in seen.out
    )


def changed(run: Run, **new) -> Run:
    from dataclasses import replace

    return replace(run, **new)


def braked(run: Run) -> Run:
    """The same run with 2 s of brakes at 30 s."""
    v = run.speed_mps - np.clip((run.time_s - 30) * 0.8, 0, 1.6)
    return changed(run, speed_mps=v)


def rising(run: Run) -> Run:
    """The car speeds up to the start of the coast-down."""
    before = np.linspace(20, run.speed_mps[0], 40)
    v = np.concatenate([before, run.speed_mps])[: len(run.time_s)]
    return changed(run, speed_mps=v)


BAD = {
    "one direction": (lambda r: [r[0], r[2], r[4]], MASS, ["1 direction found (1)", "two opposite"]),
    "too few": (lambda r: r[:3], MASS, ["1 runs in direction -1", "needed: 2 or more"]),
    "brakes": (lambda r: [*r[:3], braked(r[3]), *r[4:]], MASS, ["run 4 slows down by", "t = 30 s", "brakes"]),
    "rising": (lambda r: [*r[:3], rising(r[3]), *r[4:]], MASS, ["run 4: speed rises by", "only slows down"]),
    "few samples": (
        lambda r: [*r, changed(r[0], label="7", time_s=r[0].time_s[:5], speed_mps=r[0].speed_mps[:5])],
        MASS, ["run 7 has 5 samples"],
    ),
    "no fall": (
        lambda r: [*r, changed(r[0], label="7", time_s=r[0].time_s[:12], speed_mps=r[0].speed_mps[:12])],
        MASS, ["run 7 falls by", "needed: 11 km/h"],
    ),
    "twice": (
        lambda r: [changed(r[0], time_s=np.where(r[0].time_s == 5, 5.5, r[0].time_s)), *r[1:]],
        MASS, ["run 1: time 5.5 s follows 5.5 s"],
    ),
    "not a number": (
        lambda r: [changed(r[0], speed_mps=np.where(r[0].time_s == 5, np.nan, r[0].speed_mps)), *r[1:]],
        MASS, ["c.csv, line 12: speed is missing"],
    ),
    "copies": (
        lambda r: [*r, changed(r[0], label="7", speed_mps=np.round(r[0].speed_mps * 3.6, 3) / 3.6)],
        MASS, ["runs 1 (c.csv, lines 2 to", "and 7 (c.csv, lines", "are the same recording", "give every run once"],
    ),
    "no picture": (lambda r: r, (*MASS, "--plot", "x.txt"), ["--plot x.txt", "allowed: .png, .svg and .pdf"]),
    "no mass": (lambda r: r, (), ["inertia of wheels and shafts is missing"]),
    "no mass of the car": (lambda r: r, ("--like", "car_compact"), ["--mass-kg is missing"]),
    "no wheels": (lambda r: r, ("--mass-kg", "1300"), ["--rotating-mass-kg", "--like NAME"]),
    "both": (lambda r: r, (*MASS, "--wheel-inertia-kgm2", "2", "--tyre-radius-m", "0.3"), ["not both"]),
    "mass": (lambda r: r, ("--mass-kg", "nan", "--like", "car_compact"), ["--mass-kg nan", "50 to 100000"]),
    "directions": (lambda r: r, (*MASS, "--directions", "+,x"), ["'x'; allowed: + and -"]),
    "directions twice": (lambda r: r, (*MASS, "--directions", "+,-"), ["in a column and in --directions"]),
    "car": (lambda r: r, (*MASS, "--out", "x.toml"), ["the car file needs tyre_radius_m", "--like NAME"]),
    "own input": (lambda r: r, (*MASS, "--plot", "c.csv"), ["--plot c.csv is the file that c.csv is read from"]),
    "own model": (
        lambda r: r, (*MASS, "--like", "./like.toml", "--out", "like.toml"),
        ["--out like.toml is the file that ./like.toml is read from"],
    ),
    "column": (lambda r: r, (*MASS, "--column", "speed=v"), ["no column 'v'"]),
    "unit": (lambda r: r, (*MASS, "--unit", "speed=rpm"), ["unit 'rpm' is one of rotation"]),
}  # fmt: skip


@pytest.mark.parametrize("name", BAD)
def test_what_is_no_coast_down_is_one_clear_message(hevopt, name):
    change, arguments, said = BAD[name]
    written("c.csv", change(coast(np.random.default_rng(3), 6, noise=0.05)))
    before = sorted(Path().iterdir())
    seen = hevopt("coastdown", "c.csv", *arguments)
    assert seen.status == 2 and seen.out == "" and seen.err.count("hevopt: error: ") == 1, seen
    assert all(words in seen.err for words in said), seen.err
    assert sorted(Path().iterdir()) == before


def in_words(runs: list[Run], words: tuple[str, ...]) -> None:
    """Write c.csv with a text for each run's direction."""
    written("c.csv", runs)
    head, *rows = Path("c.csv").read_text().splitlines()
    cells = [row.split(",") for row in rows]
    rows = [",".join([run, words[int(run) - 1], *rest]) for run, _, *rest in cells]
    Path("c.csv").write_text("\n".join([head, *rows]) + "\n")


def test_two_texts_are_two_directions_and_the_first_met_is_plus(hevopt):
    runs = coast(np.random.default_rng(3), 6, grade=0.003, noise=0.05)
    written("c.csv", runs)
    numbers = hevopt("coastdown", "c.csv", *MASS)
    for one, other in (("N", "S"), ("east", "West"), ("a", "b")):
        in_words(runs, (one, other, one, other.lower(), one, other))
        seen = hevopt("coastdown", "c.csv", *MASS)
        assert f"direction: {one} counts as +1, {other} as -1" in seen.out
        assert seen.out.split("6 runs, ")[1] == numbers.out.split("6 runs, ")[1]
    swapped = [changed(run, direction=-run.direction) for run in runs]
    written("c.csv", swapped)
    assert "in direction +1: slope -0.2" in hevopt("coastdown", "c.csv", *MASS).out


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (("N", "S", "E", "S", "N", "S"), "3 directions found (N, S, E)"),
        (("N", "1", "N", "1", "N", "1"), "c.csv, line 99: direction is missing, or not one of two"),
        (("N", "", "N", "S", "N", "S"), "c.csv, line 99: direction is missing, or not one of two"),
    ],
)  # fmt: skip
def test_texts_that_are_not_two_directions_are_refused(hevopt, words, said):
    runs = coast(np.random.default_rng(3), 6, grade=0.003, noise=0.05)
    in_words(runs, words)
    seen = hevopt("coastdown", "c.csv", *MASS)
    assert seen.status == 2
    assert said.replace("99", str(len(runs[0].time_s) + 2)) in seen.err, seen.err


def test_a_gap_in_time_parts_runs_and_a_log_without_one_says_how(hevopt):
    runs = coast(np.random.default_rng(3), 4, noise=0.05)
    written("c.csv", runs)
    apart = hevopt("coastdown", "c.csv", *MASS)
    for pause_s, status in ((6.0, 0), (4.0, 2)):
        shifted, start = [], 0.0
        for run in runs:
            shifted.append(changed(run, time_s=run.time_s + start))
            start = shifted[-1].time_s[-1] + pause_s
        written("log.csv", shifted, "time [s],v [km/h]", 2)
        seen = hevopt("coastdown", "log.csv", *MASS, "--directions", "+,-,+,-")
        assert seen.status == status
        if status:
            for words in (
                "the files hold 1",
                "a column run",
                "a file for each",
                "a gap in time of more than 5 s",
            ):
                assert words in seen.err, words
        else:
            assert "a gap in time begins a new run in line " in seen.out
            assert seen.out.split("4 runs, ")[1] == apart.out.split("4 runs, ")[1]


def test_no_interval_is_printed_as_zero(hevopt):
    runs = coast(np.random.default_rng(3), 4, grade=0.001)
    nearly = [
        changed(run, time_s=run.time_s[k:], speed_mps=run.speed_mps[k:])
        for k, run in enumerate(runs)
    ]
    written("c.csv", nearly)
    seen = hevopt("coastdown", "c.csv", *MASS)
    widths = re.findall(r"± (<?)([0-9.]+) N", seen.out)
    assert len(widths) == 9 and all(float(width) > 0 for _, width in widths)
    assert "C0 =   110.000 ± <0.001 N" in seen.out and "± <0.1 N" in seen.out
    assert "agree better than measured ones can" in seen.out


@pytest.mark.parametrize(
    ("name", "start"), [("c.svg", b"<?xml"), ("c.pdf", b"%PDF"), ("c.PNG", b"\x89PNG")]
)
def test_the_picture_is_of_the_kind_its_name_says_and_the_same_each_time(hevopt, name, start):
    written("c.csv", coast(np.random.default_rng(3), 4, noise=0.05))
    pictures = []
    for _ in range(2):
        seen = hevopt("coastdown", "c.csv", *MASS, "--plot", name)
        assert seen.status == 0 and "no car file written; --out FILE writes the car" in seen.out
        pictures.append(Path(name).read_bytes())
    assert pictures[0].startswith(start) and pictures[0] == pictures[1]


def test_without_a_file_to_write_it_says_so(hevopt):
    written("c.csv", coast(np.random.default_rng(3), 4, noise=0.05))
    before = sorted(Path().iterdir())
    seen = hevopt("coastdown", "c.csv", *MASS)
    assert "no file written; --out FILE writes the car" in seen.out
    assert sorted(Path().iterdir()) == before


def test_fewer_than_two_runs_in_a_direction_are_no_fit():
    runs = coast(np.random.default_rng(1), 4)
    for k in (1, 3):
        with pytest.raises(DataError, match="needed: 2 or more"):
            fit_road_load(runs[:k], MASS_KG + ROTATING_KG)


def test_winds_that_differ_by_run_are_taken_out_without_bias():
    """Each run is an exact quadratic: C0 of (12) is known, with what the scatter of e adds to the square of e."""
    winds_mps = np.array([0.0, 3.0, 6.0])
    pairs = [coast(np.random.default_rng(1), 2, wind=w, speeds=((34.0, 8.0),)) for w in winds_mps]
    fit = fit_road_load([run for pair in pairs for run in pair], MASS_KG + ROTATING_KG)
    constant = TRUTH[0] + TRUTH[2] * np.mean(winds_mps**2)
    e = 2 * TRUTH[2] * winds_mps.mean()
    # Half the difference of two means of three runs, each run's 2 C2 w.
    variance_of_e = 2 * (2 * TRUTH[2]) ** 2 * winds_mps.var(ddof=1) / 3 / 4
    expected = constant - (e**2 - variance_of_e) / (4 * TRUTH[2])
    assert variance_of_e / (4 * TRUTH[2]) > 0.5
    assert fit.coefficients[0] == pytest.approx(expected, abs=0.01)


def test_of_hundreds_of_columns_a_message_names_the_first(hevopt):
    Path("runs.csv").write_text(
        "\n".join([",".join(f"x{n}" for n in range(500)), "1," * 499 + "1"])
    )
    seen = hevopt("coastdown", "runs.csv", "--mass-kg", "1350", "--like", "car_compact")
    assert seen.status == 2 and "no column of time" in seen.err and " more" in seen.err
    assert len(seen.err) < 1000
