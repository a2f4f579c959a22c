"""Verdicts of the reproduction: what reaches a published figure, passes it or leaves it, on figures made up."""

import pytest

from hevopt.reproduction.cases import Reproduction, Under
from hevopt.reproduction.members import Member
from hevopt.reproduction.published import STATEMENTS, Figures, percent
from hevopt.reproduction.verdicts import points_off, signed, standing, starred, verdict


def cells(line):
    return [cell.strip() for cell in line.strip().strip("|").split("|")]


def cases_of_b(fuel_percent):
    b = Figures(5.0 + 0.05 * fuel_percent, 200.0)
    return {("A", "baseline"): Figures(5.0, 200.0), ("B", "start_stop"): b}


def under_of_b(name, fuel_percent, driven=None, surplus=None):
    case = cases_of_b(fuel_percent)
    off = {} if surplus is None else {("B", "start_stop"): surplus}
    return Under(name, case, case if driven is None else cases_of_b(driven), off)


def reproduction_of_b(fuel_percent):
    return Reproduction(None, under_of_b("as shipped", fuel_percent), {}, {}, {}, {}, {}, {})


def test_points_off_start_beyond_the_rounding_of_the_published_figure():
    b, c2 = STATEMENTS[0], STATEMENTS[1]
    assert points_off(b, -6.49) == points_off(b, -5.51) == 0
    assert points_off(b, -4.5) == pytest.approx(1.5)
    assert points_off(b, -6.6) == pytest.approx(-0.6)
    assert points_off(c2, -23.5) == points_off(c2, -24.4) == points_off(c2, -22.6) == 0
    assert points_off(c2, -22.0) == pytest.approx(1.0)


def test_a_verdict_names_what_reaches_and_what_passes_or_what_is_left():
    found = reproduction_of_b(-4.0)
    near, beyond, little = (
        under_of_b(name, value)
        for name, value in (("near", -6.2), ("beyond", -9.0), ("little", -4.5))
    )
    said = verdict(STATEMENTS[0], found, [near, beyond, little])
    assert said == "+2.0 points off. Reached with: near (-6.2 %). Passed with: beyond (-9.0 %)."
    said = verdict(STATEMENTS[0], found, [little])
    assert said == (
        "+2.0 points off. Not explained: the closest, little (-4.5 %), leaves +1.5 points."
    )
    same = reproduction_of_b(-6.1)
    assert "is what is published" in verdict(STATEMENTS[0], same, [little])


def test_a_starred_value_reaches_only_where_it_does_as_driven_too():
    found, b = reproduction_of_b(-4.0), STATEMENTS[0]
    short = under_of_b("short", -6.2, driven=-4.9, surplus=2.0)
    both = under_of_b("both", -6.2, driven=-5.6, surplus=2.0)
    far = under_of_b("far", -8.0, driven=-6.1, surplus=3.0)
    assert verdict(b, found, [short]) == (
        "+2.0 points off. Reached only after correction with: short (-6.2 %*, as driven -4.9 %)."
    )
    assert standing(b, found, [short]) == "reached only after correction"
    assert standing(b, found, [far]) == "passed only after correction"
    beyond = under_of_b("beyond", -9.0)
    assert standing(b, found, [beyond]) == "lies between ours and a variation's"
    assert standing(b, found, [short, both]) == "reached by a variation"
    table = starred([short, under_of_b("neutral", -6.2)], [b])
    assert cells(table.splitlines()[-1]) == ["short", b.what, "B start_stop +2.0", "-6.2", "-4.9"]
    assert starred([under_of_b("neutral", -6.2)], [b]) == ""


def test_nox_is_not_corrected_and_not_shown_as_if_it_were():
    short = under_of_b("short", -6.2, driven=-4.9, surplus=2.0)
    table = starred([short], [STATEMENTS[3]])
    assert cells(table.splitlines()[-1])[-2:] == ["0.0", "not corrected"]


def over_conventional(fuel_percent, nox_percent):
    """E and D with one and the same change of nox_cut over conventional."""
    base = {(car, "conventional"): Figures(3.0, 200.0) for car in "ED"}
    cut = Figures(3.0 + 0.03 * fuel_percent, 200.0 + 2 * nox_percent)
    return Under("as shipped", base | {(car, "nox_cut"): cut for car in "ED"}, {}, {})


def cut(fuel_percent, nox_percent, *, neutral=True):
    return Member(0.0, fuel_percent, nox_percent, fuel_percent, 0.0, neutral)


def test_two_points_of_a_car_are_reached_by_a_milder_cut_only_if_one_cut_meets_both():
    e_fuel, d_fuel, e_nox, c1_nox = STATEMENTS[5:9]
    apart = [cut(1.7, -7.3), cut(5.0, -6.8), cut(2.5, -6.0, neutral=False), cut(1.8, 0.0)]
    found = Reproduction(None, over_conventional(12.0, -15.0), {}, {}, {}, {"E": apart}, {}, {})
    said = verdict(e_fuel, found, [])
    assert "2 of the family's 3 neutral members" in said
    for statement in (e_fuel, e_nox):
        assert (
            "every point of E at once: none; the nearest changes fuel by +1.7 % and NOx by -7.3 %"
            in (verdict(statement, found, []))
        )
        assert standing(statement, found, []) == (
            "reached by a milder cut, which misses the car's other point"
        )
    families = {"E": [*apart, cut(3.4, -6.9)], "D": [cut(11.2, -9.0)]}
    both = Reproduction(None, over_conventional(12.0, -15.0), {}, {}, {}, families, {}, {})
    assert "every point of E at once: 1." in verdict(e_nox, both, [])
    assert standing(e_nox, both, []) == "reached by a milder cut"
    # D has one point.
    assert standing(d_fuel, both, []) == "reached by a milder cut"
    assert "at once" not in verdict(d_fuel, both, [])
    # "No gain" is not reached by a cut that does nothing.
    none = {
        ("C1", name): Figures(3.0, nox) for name, nox in (("conventional", 200), ("nox_cut", 150))
    }
    still = Reproduction(
        None, Under("x", none, {}, {}), {}, {}, {}, {"C1": [cut(0.0, 0.0)]}, {}, {}
    )
    assert standing(c1_nox, still, []) == "**not explained**"


def test_signs_and_rounding():
    assert [signed(x) for x in (-0.04, 0.0, 0.05001, -12.34)] == ["0.0", "0.0", "+0.1", "-12.3"]
    assert percent(90.0, 100.0) == pytest.approx(-10)
