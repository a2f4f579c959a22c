"""Rows of a comparison driven forward."""

import dataclasses
import json

import numpy as np
import pytest

from hevopt import compare, load_architecture
from hevopt.driving.cycle import Cycle
from hevopt.output import file_tables, terminal_tables
from hevopt.output.tables import needed_width


@pytest.fixture(scope="module")
def hop():
    time_s = np.arange(41.0)
    speed = np.interp(time_s, [0, 5, 15, 25, 35, 40], [0, 0, 10, 10, 0, 0])
    return Cycle("hop", time_s, speed, np.zeros(41))


@pytest.fixture(scope="module")
def comparison(hop):
    # Tyres that slip are not for an engine whose speed is its own: such a car is not driven.
    split = load_architecture("prius_1998")
    tyre = split.handling.tyre._replace(slips=True)
    slipping = dataclasses.replace(split, handling=split.handling._replace(tyre=tyre))
    return compare(hop, ["C2", slipping], ["dp", "conventional"], forward=True)


def test_every_row_has_its_forward_figures_or_says_why_it_was_not_driven(comparison):
    assert set(comparison.forward) == {(row.architecture, row.strategy) for row in comparison.rows}
    dp, rule = (comparison.forward["C2", name] for name in ("dp", "conventional"))
    assert not dp.decided and rule.decided
    assert dp.violations == 0 and dp.rmsse_kmh < 0.5
    assert abs(dp.change_percent) < 10
    for name in ("dp", "conventional"):
        left_out = comparison.forward["prius_1998", name]
        assert left_out.fuel_l_per_100km is None and left_out.status.startswith("not driven: ")
        assert "prius_1998" in left_out.status


def test_the_plan_of_a_strategy_that_is_brought_along_is_replayed(hop):
    from hevopt.strategies import dp

    found = compare(hop, ["C2"], {"mine": lambda problem: dp.solve(problem).control}, forward=True)
    assert found.forward["C2", "mine"].decided is False
    assert found.forward["C2", "mine"].violations == 0


def test_tables_json_and_frames_have_the_forward_columns(comparison):
    frame = comparison.to_frame()
    assert frame["forward_violations"].tolist()[0] == 0
    assert frame["forward_decided"].tolist()[:2] == [False, True]
    rows = json.loads(file_tables.result_json(comparison, {}))["rows"]
    assert rows[0]["forward_change_percent"] == comparison.forward["C2", "dp"].change_percent
    assert rows[2]["forward_fuel_l_per_100km"] is None
    table = terminal_tables.comparison_table(comparison, 100)
    heads = [str(column.header) for column in table.columns]
    assert {"driven\nl/100km", "against\n%", "RMSSE\nkm/h", "missed\n"} <= set(heads)
    assert needed_width(table) <= 100
    assert "prius_1998 dp, driven: not driven: " in terminal_tables.comparison_notes(comparison)


def test_without_being_asked_for_nothing_is_driven(comparison):
    plain = compare("nedc", ["A"], ["baseline"])
    assert not plain.forward
    assert not any(name.startswith("forward_") for name in plain.to_frame())
    heads = [str(column.header) for column in terminal_tables.comparison_table(plain).columns]
    assert "driven\nl/100km" not in heads
