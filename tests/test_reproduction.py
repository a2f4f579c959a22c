"""The reproduction page: its figures are those of the model, its verdicts follow from them, its tables render."""

import re
from functools import cache
from pathlib import Path

import numpy as np
import pytest

from hevopt import load_cycle
from hevopt.published import CYCLE, STATEMENTS, Figures, percent
from hevopt.reproduction import variations as v
from hevopt.reproduction.cases import Reproduction, Under, curve, reproduce, under, wheel_work
from hevopt.reproduction.page import page
from hevopt.reproduction.variations import varied
from hevopt.reproduction.verdicts import points_off, signed, verdict

PAGE = Path(__file__).parents[1] / "reports" / "reproduction.md"
# Half of the last digit printed, and what another processor may round differently.
NEAR = 0.05 + 1e-3


def cells(line):
    return [cell.strip() for cell in line.strip().strip("|").split("|")]


@cache
def tables():
    """Section -> its tables, each a list of rows of cells, the heads first."""
    found, section, before = {}, "", ""
    for line in PAGE.read_text().splitlines():
        if line.startswith("## "):
            section = line[3:]
        if line.startswith("|"):
            if not before.startswith("|"):
                found.setdefault(section, []).append([])
            found[section][-1].append(cells(line))
        before = line
    return found


def row_of(section, first, table=0):
    rows = next(t for name, t in tables().items() if name.startswith(section))[table]
    return next(row for row in rows if row[0] == first)


def number(cell):
    return float(cell.rstrip("*").removesuffix(" %").removesuffix(" MJ/km"))


def cases_of_b(fuel_percent):
    b = Figures(5.0 + 0.05 * fuel_percent, 200.0)
    return {("A", "baseline"): Figures(5.0, 200.0), ("B", "start_stop"): b}


def test_the_committed_page_is_that_of_this_model():
    """A few rows of it, worked out afresh."""
    cycle = load_cycle(CYCLE)
    shipped = under(v.AS_SHIPPED, cycle, ["A", "B", "C2"])
    row = row_of("1.", "as shipped")
    assert number(row[1]) == pytest.approx(shipped.cases["A", "baseline"][0], abs=1.5e-3)
    assert number(row[2]) == pytest.approx(STATEMENTS[0].ours(shipped.cases), abs=NEAR)
    assert number(row_of("Point", "C2 conventional, fuel")[2]) == pytest.approx(
        STATEMENTS[1].ours(shipped.cases), abs=NEAR
    )
    rested = under(v.K_PHASES, cycle, ["A", "B"])
    assert number(row_of("1.", v.K_PHASES.name)[2]) == pytest.approx(
        STATEMENTS[0].ours(rested.cases), abs=NEAR
    )
    halved = under(v.BRAKING[1], cycle, ["A", "C2"])
    assert number(row_of("2.", v.BRAKING[1].name)[2]) == pytest.approx(
        STATEMENTS[1].ours(halved.cases), abs=NEAR
    )
    for member, kw in zip(
        curve("C2", cycle, shipped.cases["A", "baseline"], [1, 6, 12]), ("1", "6", "12"), strict=True
    ):  # fmt: skip
        found = row_of("2.", kw, table=2)
        assert number(found[3]) == pytest.approx(member.fuel_percent, abs=NEAR)
        assert number(found[4]) == pytest.approx(member.nox_percent, abs=NEAR)
        assert found[3].endswith("*") != member.neutral
    for what, work in wheel_work(cycle).items():
        assert number(row_of("6.", what)[1]) == pytest.approx(work, abs=1.5e-3)


def test_every_table_of_the_page_is_rectangular_and_every_link_leads_somewhere():
    text = PAGE.read_text()
    assert sum(len(group) for group in tables().values()) >= 12
    for group in tables().values():
        for rows in group:
            assert len({len(row) for row in rows}) == 1
            assert all(re.fullmatch("-{3}:?", cell) for cell in rows[1])
    heads = [line.lstrip("# ") for line in text.splitlines() if line.startswith("#")]
    slugs = {re.sub(r"[^\w -]", "", head.lower()).replace(" ", "-") for head in heads}
    links = re.findall(r"\]\(#([^)]*)\)", text)
    assert len(links) >= 10 and set(links) <= slugs
    assert "nan" not in text.lower().split() and "+0.0 " not in text and "-0.0 " not in text


def test_every_published_statement_is_a_row_with_ours_beside_it():
    for statement in STATEMENTS:
        row = row_of("Point", statement.what)
        assert row[1] == statement.published
        off = points_off(statement, number(row[2]))
        said = 0.0 if row[3] == "within rounding" else float(row[3].split()[0])
        assert said == pytest.approx(off, abs=NEAR)


def test_points_off_start_beyond_the_rounding_of_the_published_figure():
    b, c2 = STATEMENTS[0], STATEMENTS[1]
    assert points_off(b, -6.49) == points_off(b, -5.51) == 0
    assert points_off(b, -4.5) == pytest.approx(1.5)
    assert points_off(b, -6.6) == pytest.approx(-0.6)
    assert points_off(c2, -23.5) == points_off(c2, -24.4) == points_off(c2, -22.6) == 0
    assert points_off(c2, -22.0) == pytest.approx(1.0)


def test_a_verdict_names_what_reaches_and_what_passes_or_what_is_left():
    none = frozenset()
    found = Reproduction(None, Under("as shipped", cases_of_b(-4.0), none), {}, {}, {}, {}, {})
    near, beyond, little = (
        Under(name, cases_of_b(value), none)
        for name, value in (("near", -6.2), ("beyond", -9.0), ("little", -4.5))
    )
    said = verdict(STATEMENTS[0], found, [near, beyond, little])
    assert said == "+2.0 points off. Reached with: near (-6.2 %). Passed with: beyond (-9.0 %)."
    said = verdict(STATEMENTS[0], found, [little])
    assert said == (
        "+2.0 points off. Not explained: the closest, little, gives -4.5 % and leaves +1.5 points."
    )
    same = Reproduction(None, Under("as shipped", cases_of_b(-6.1), none), {}, {}, {}, {}, {})
    assert "is what is published" in verdict(STATEMENTS[0], same, [little])


def test_signs_and_rounding():
    assert [signed(x) for x in (-0.04, 0.0, 0.05001, -12.34)] == ["0.0", "0.0", "+0.1", "-12.3"]
    assert percent(90.0, 100.0) == pytest.approx(-10)


def test_without_k_phases_the_gear_is_neutral_at_standstill_and_nothing_else_is_another():
    cycle = load_cycle(CYCLE)
    changed = v.neutral_at_standstill(cycle)
    moved = np.diff(cycle.time_s)[(changed.gear != cycle.gear)[:-1]]
    assert moved.sum() == 12 * 5 + 20  # 12 of 5 s in the urban part, one of 20 s before the other
    standing = cycle.speed_mps[1:] + cycle.speed_mps[:-1] == 0
    assert (changed.gear[:-1][standing] == 0).all()
    assert (changed.gear[:-1][~standing] == cycle.gear[:-1][~standing]).all()


def test_above_the_electric_limit_the_engine_burns_and_every_step_keeps_a_control():
    _, cycle, shipped = varied("C2", load_cycle(CYCLE), v.AS_SHIPPED)
    _, _, limited = varied("C2", cycle, v.ELECTRIC[1])
    signals = shipped.table.signals
    fast = (signals.speed_mps * 3.6 > v.ELECTRIC_KMH[1]) & (signals.wheel_power_w > 0)
    without_fuel = limited.table.feasible & (limited.table.fuel_kg == 0)
    assert fast.any() and not without_fuel[fast].any()
    assert limited.table.feasible.any(axis=1).all()
    assert (limited.table.feasible[~fast] == shipped.table.feasible[~fast]).all()


def test_the_machine_takes_no_more_than_its_share_of_the_braking():
    _, _, shipped = varied("D", load_cycle(CYCLE), v.AS_SHIPPED)
    _, _, limited = varied("D", load_cycle(CYCLE), v.BRAKING[1])
    flows, wheel_w = limited.table.flows, limited.table.signals.wheel_power_w
    taken = -flows["machine_torque_nm"] * flows["machine_speed_radps"]
    allowed = np.maximum(-v.BRAKING_SHARES[1] * wheel_w, 0)[:, None]
    braking = (wheel_w < 0) & shipped.table.feasible.any(axis=1)
    assert (taken <= allowed + 1e-9)[limited.table.feasible & braking[:, None]].all()
    assert limited.table.feasible.any(axis=1).all()
    assert (limited.table.feasible[~braking] == shipped.table.feasible[~braking]).all()


@pytest.mark.long
def test_the_whole_page_comes_out_again():
    made = page(reproduce())
    number_in = re.compile(r"[-+]?\d+\.?\d*")
    assert number_in.sub("#", made) == number_in.sub("#", PAGE.read_text())
    ours, theirs = (
        [float(x) for x in number_in.findall(text)] for text in (made, PAGE.read_text())
    )
    # A digit of the last place, where rounding falls the other way.
    assert ours == pytest.approx(theirs, abs=0.11)
