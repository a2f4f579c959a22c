"""The tip-in study's page: its figures are the model's, its verdicts follow from them, its tables are whole."""

import re
from dataclasses import replace
from pathlib import Path

import pytest
from diesels import shipped

from hevopt.mean_value.car import BENCH, model_of
from hevopt.mean_value.full_load import full_load
from hevopt.reproduction.turbo_lag import cases, page
from hevopt.reproduction.turbo_lag.cases import FOURTH, LARGE, SIXTH, SMALL, TurboLag
from hevopt.reproduction.turbo_lag.figure import filled_figure
from hevopt.tipin.bands import Band
from hevopt.tipin.case import BASE
from hevopt.tipin.drive import tip_in

COMMITTED = (Path(__file__).parents[3] / "reports" / "tipin.md").read_text("utf-8")


@pytest.fixture(scope="module")
def base():
    return tip_in(cases._manoeuvre(SMALL, FOURTH), BASE)


@pytest.fixture(scope="module")
def filled(monkeypatch_module):
    """D at 40 km/h in IV, whose machine is too small, and at 60 in VI."""
    monkeypatch_module.setattr(cases, "_HALVINGS", 1)
    return [cases._filled("D", pedal) for pedal in (FOURTH, SIXTH)]


@pytest.fixture(scope="module")
def monkeypatch_module():
    with pytest.MonkeyPatch.context() as patch:
        yield patch


@pytest.fixture(scope="module")
def found(base, filled) -> TurboLag:
    """A study whose parts are the same few runs."""
    diesel = shipped(SMALL)
    speeds = diesel.car.engine.full_load_speed_radps[[3, 9, 11]]
    curve = full_load(model_of(diesel.diesel, BENCH), speeds), diesel.car.engine
    every = {(car, pedal): base for car in (SMALL, LARGE) for pedal in (FOURTH, SIXTH)}
    several = {"turbo inertia x 2": base}
    return TurboLag(
        every, dict.fromkeys(every, 3e-7), dict.fromkeys(("smoke limit 1.1", "smoke limit 1.4"), base),
        several, several, several, base, tuple(filled), {SMALL: curve, LARGE: curve},
        (Band("a figure", 1.0, 2.0, 2.5),),
    )  # fmt: skip


def row(text: str, first: str) -> list[str]:
    line = next(line for line in text.splitlines() if line.startswith(f"| {first} |"))
    return [cell.strip() for cell in line.strip("|").split("|")][1:]


def test_the_committed_page_is_that_of_this_model(base, filled):
    """Two rows of it, driven afresh."""
    told = [float(cell) for cell in row(COMMITTED, "1.3 l, `compact_1300`, 40 km/h, IV")]
    assert told[:5] == pytest.approx(base.figures.accel_mps2, abs=6e-3)
    assert told[5:10] == pytest.approx(base.figures.ratio, abs=6e-3)
    assert told[10] == pytest.approx(base.figures.boost_90_s, abs=6e-3)
    told = row(COMMITTED, "40 km/h, IV, D")
    assert float(told[3]) == pytest.approx(100 * filled[0].helped.assist.filled, abs=0.6)
    assert float(told[4]) == pytest.approx(filled[0].helped.assist.work_j / 1e3, abs=0.06)
    assert told[8:] == ["machine", "-", "-"]


def test_claims_stand_on_the_committed_page_as_they_are():
    """At 0.3 s the map is a little more than twice as fast: said, not tuned."""
    claims = COMMITTED.split("## Claim by claim")[1].split("\n## ")[0]
    stands = [line.rsplit("|", 2)[1].strip() for line in claims.splitlines() if "| (" in line]
    assert [word.split(":")[0] for word in stands] == [
        "**does not agree**", "open", "open", "agrees", "agrees", "ours has none either",
    ]  # fmt: skip
    assert "it is more than twice until 0.4" in stands[0] and "**no**" not in COMMITTED


def test_a_machine_too_small_is_said_and_one_that_fills_is_made_as_small_as_does(filled):
    fourth, sixth = filled
    assert fourth.least_w is None and not cases.feels_alike(fourth.helped)
    assert max(fourth.helped.figures.ratio) < max(fourth.alone.figures.ratio)
    assert sixth.least_w in (7500.0, 15000.0)


def test_the_page_is_made_of_what_was_found(found):
    text = page.page(found, "p.png")
    for table in re.findall(r"(?:^\|.*\n)+", text, re.M):
        assert len({line.count("|") for line in table.splitlines()}) == 1, table
    assert "![Acceleration" in text and "](p.png)" in text
    assert "| a figure | 1 | 2 | 2.50 | **no** |" in text
    # Two smoke limits with one pattern.
    assert "**does not agree**" in row(
        text, "(d) 60 km/h, VI: three smoke maps give three patterns of acceleration"
    )
    assert (
        "At 40 km/h, IV no machine makes the diesel feel like its steady map; D stays up to" in text
    )
    assert "below 1e-6" in text
    picture = filled_figure(found)
    assert picture.startswith(b"\x89PNG") and picture == filled_figure(found)


def test_what_is_not_twice_does_not_agree(found, base):
    """Nor what is so only at another time; twice, it agrees."""
    for run, by_map, ratio, stands in (
        (base.run, base.by_map, (1.3, 1.2, 1.1, 1.05, 1.0), "**does not agree**"),
        (base.run, base.run, (1.0,) * 5, "it is never twice"),
        (base.run, base.by_map, (2.1, 1.8, 1.4, 1.2, 1.1), "agrees"),
    ):
        other = replace(base, run=run, by_map=by_map, figures=replace(base.figures, ratio=ratio))
        text = page._claim_of_twice(replace(found, shipped=dict.fromkeys(found.shipped, other)))[2]
        assert stands in text and text.startswith("agrees") == (stands == "agrees")


def test_the_command_writes_page_and_picture(found, hevopt, tmp_path, monkeypatch):
    monkeypatch.setattr(cases, "turbo_lag", lambda progress: found)
    seen = hevopt("turbo-lag", "--out", "study.md")
    assert seen.status == 0, seen.err
    assert "](study.png)" in (tmp_path / "study.md").read_text("utf-8")
    assert (tmp_path / "study.png").read_bytes().startswith(b"\x89PNG")
    seen = hevopt("turbo-lag", "--out", "nowhere/study.md")
    assert seen.status == 2 and "nowhere" in seen.err
