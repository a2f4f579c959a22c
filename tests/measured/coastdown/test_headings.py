"""Coast-downs whose direction is a heading: two opposite groups of runs, however the heading varies."""

from pathlib import Path

import numpy as np
import pytest

MASS = ("--mass-kg", "1300", "--rotating-mass-kg", "50")


def written(headings, head="run,heading [deg],time_s,speed_kmh", runs=True, noise=2.0, factor=1.0):
    """Write c.csv: a run for each heading, its deceleration by the wind along 40°."""
    rng = np.random.default_rng(3)
    rows, start_s = [], 0.0
    for k, heading in enumerate(headings):
        t = np.arange(0, 60, 0.5)
        wind = 0.02 * np.cos(np.radians(heading - 40))
        v = 34 - (0.35 + wind) * t + 0.001 * t**2 + 0.01 * rng.normal(size=len(t))
        shown = (heading + noise * rng.normal(size=len(t))) % 360 * factor
        rows += [
            ",".join([str(k + 1)] * runs + [f"{h:.4f}", f"{start_s + s:.1f}", f"{u * 3.6:.4f}"])
            for h, s, u in zip(shown, t, v, strict=True)
        ]
        start_s += 100 if runs else 60
    Path("c.csv").write_text("\n".join([head, *rows]) + "\n")


def coefficients(seen):
    assert seen.status == 0, seen.err
    return seen.out[seen.out.index("C0 =") :]


@pytest.mark.parametrize("first", [87, 359, 180])
def test_a_heading_that_varies_is_two_directions(hevopt, first):
    headings = [first, first + 180] * 3
    written(headings, "run,direction,time_s,speed_kmh", noise=0)
    names = Path("c.csv").read_text()
    for heading, sign in ((first, "1"), (first + 180, "-1")):
        names = names.replace(f",{heading % 360:.4f},", f",{sign},")
    Path("c.csv").write_text(names)
    plain = coefficients(hevopt("coastdown", "c.csv", *MASS))
    written(headings)
    seen = hevopt("coastdown", "c.csv", *MASS)
    assert coefficients(seen) == plain
    note = f"heading about {first}° counts as +1, {(first + 180) % 360}° as -1"
    assert note in seen.out
    # Without a column of runs, the turn between them parts them; other units say the same.
    written(headings, "heading [deg],time_s,speed_kmh", runs=False)
    assert coefficients(hevopt("coastdown", "c.csv", *MASS)) == plain
    written(headings, "heading [rad],time_s,speed_kmh", runs=False, factor=np.pi / 180)
    assert coefficients(hevopt("coastdown", "c.csv", *MASS)) == plain
    written(headings, "run,heading,time_s,speed_kmh")
    assert coefficients(hevopt("coastdown", "c.csv", *MASS, "--unit", "direction=deg")) == plain


@pytest.mark.parametrize(
    ("headings", "head", "options", "said"),
    [
        ([87, 267] * 3, "run,heading,time_s,speed_kmh", (), "a heading needs its unit, as heading [deg] or --unit"),
        ([87, 88] * 3, None, (), "1 direction found (heading about 88°)"),
        ([87, 217] * 3, None, (), "no two opposite directions: 87° and 217° on average"),
        ([87, 267, 87, 267, 147, 267], None, (), "lines 482 to 601 147°"),
        ([87, 267] * 3, None, ("--unit", "direction=km/h"), "needed is angle"),
        ([87, 267] * 3, "run,x,time_s,speed_kmh", ("--unit", "direction=deg"), "--unit direction without a column"),
    ],
)  # fmt: skip
def test_headings_that_are_no_two_directions_are_one_clear_message(
    hevopt, headings, head, options, said
):
    written(headings, *([head] if head else []))
    seen = hevopt("coastdown", "c.csv", *MASS, *options)
    assert seen.status == 2 and said in seen.err and seen.err.count("hevopt: error: ") == 1, (
        seen.err
    )


def test_a_run_that_turns_is_refused(hevopt):
    written([87, 267] * 3)
    head, *rows = Path("c.csv").read_text().splitlines()
    cells = [row.split(",") for row in rows]
    for k, row in enumerate(cells[:120]):
        row[1] = f"{50 + k:.1f}"
    Path("c.csv").write_text("\n".join([head, *map(",".join, cells)]) + "\n")
    seen = hevopt("coastdown", "c.csv", *MASS)
    assert (
        seen.status == 2
        and "lines 2 to 121: the heading is up to 60° off its mean of 110°" in seen.err
    )
