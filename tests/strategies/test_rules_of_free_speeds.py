"""What the theory page says of rules on cars whose engine's speed is free."""

import re
from pathlib import Path

import pytest

from hevopt import load_architecture, load_cycle, simulate
from hevopt.strategies import STRATEGIES
from hevopt.studies.case import prepare

PAGE = Path(__file__).parents[2] / "docs" / "theory" / "strategies.md"


def above_percent(case, rule: str) -> float:
    """How far a rule's cost lies above the bound at its own end charge."""
    run = simulate(case.problem, STRATEGIES[rule].solve(case.problem).control)
    bound_kg, _ = case.certificate.bound_kg(run.end_j)
    return 100 * (run.cost_kg / bound_kg - 1)


def test_figures_of_the_page_are_those_of_the_rules():
    text = " ".join(PAGE.read_text().split())
    told = re.search(
        r"`power_follower` is ([\d.]+) % above the bound on `series_1500` and ([\d.]+) % on `prius_1998` "
        r"\(`conventional`: ([\d.]+) and ([\d.]+) %\), `thermostat` ([\d.]+) % on the former",
        text,
    )
    series, prius = (
        prepare(load_architecture(car), load_cycle("udds")) for car in ("series_1500", "prius_1998")
    )
    follows = [above_percent(case, "power_follower") for case in (series, prius)]
    usual = [above_percent(case, "conventional") for case in (series, prius)]
    found = [*follows, *usual, above_percent(series, "thermostat")]
    assert [float(figure) for figure in told.groups()] == pytest.approx(found, abs=0.051)
