"""The energy flows add up, against the trajectory and against the fuel."""

from collections import defaultdict

import numpy as np
import pytest

ENDS = {"Fuel", "Battery, drawn", "Downhill", "Shafts at the start"}


CASES = [
    ("A", "baseline"), ("B", "dp"), ("C1", "nox_cut"), ("C2", "dp"), ("D", "ecms"), ("E", "conventional"),
]  # fmt: skip


@pytest.fixture(params=CASES, ids="-".join)
def row(nedc, request):
    detail = next(
        row.detail
        for row in nedc.results.rows
        if (row.figures.architecture, row.figures.strategy) == request.param
    )
    return detail.energy, *nedc.solved[request.param]


def _named(items):
    return {item.name: item.energy_j for item in items}


def test_what_is_taken_is_what_is_spent(row):
    energy = row[0]
    taken, spent = sum(_named(energy.taken).values()), sum(_named(energy.spent).values())
    assert taken == pytest.approx(spent + energy.residual_j, rel=1e-12)
    assert abs(energy.residual_j) < 1e-9 * taken


def test_what_flows_into_every_place_flows_out_of_it(row):
    flow = defaultdict(lambda: [0.0, 0.0])
    for link in row[0].links:
        assert link.energy_j > 0
        flow[link.source][1] += link.energy_j
        flow[link.target][0] += link.energy_j
    inner = {place: both for place, both in flow.items() if all(both)}
    assert len(inner) >= 4
    for place, (into, out) in inner.items():
        assert into == pytest.approx(out, rel=1e-6), place
    sources = {place for place, (into, _) in flow.items() if into == 0}
    assert sources <= ENDS
    total_in = sum(out for into, out in flow.values() if into == 0)
    total_out = sum(into for into, out in flow.values() if out == 0)
    assert total_in == pytest.approx(total_out, rel=1e-6)


def test_links_agree_with_the_balance(row):
    energy = row[0]
    into = defaultdict(float)
    for link in energy.links:
        into[link.target] += link.energy_j
    drawn = sum(link.energy_j for link in energy.links if link.source == "Battery, drawn")
    spent, taken = _named(energy.spent), _named(energy.taken)
    scale = taken["fuel burnt"]
    pairs = [
        *((into[name], spent[name]) for name in spent),
        (drawn - into["Battery, stored"], taken["stored energy drawn, net"]),
    ]
    losses = {link.target for link in energy.links} - {link.source for link in energy.links}
    assert losses <= set(spent) | {"Battery, stored"}
    for links, balance in pairs:
        assert links == pytest.approx(balance, abs=1e-6 * scale)


def test_the_ends_are_those_of_the_trajectory(row):
    energy, case, _, trajectory = row
    taken, of_which = _named(energy.taken), _named(energy.of_which)
    fuel_j = case.car.engine.heating_value_jpkg * trajectory.total_fuel_kg
    assert taken["fuel burnt"] + taken["fuel of starts and shifts"] == pytest.approx(fuel_j)
    drawn_j = case.problem.start_j - trajectory.end_j
    assert taken["stored energy drawn, net"] == pytest.approx(drawn_j, abs=1e-3)
    step_s, power_w = case.problem.table.step_s, trajectory.battery_power_w
    assert of_which["out of the battery, at its terminals"] == pytest.approx(
        float(np.sum(power_w[power_w > 0] * step_s[power_w > 0]))
    )


def test_the_printed_balance_adds_up_to_its_last_digit(nedc, shown):
    cells = shown.page.evaluate(
        "[...document.querySelectorAll('table.balance')].map(table => [...table.tBodies].map(body =>"
        " [...body.querySelectorAll('td:nth-child(2)')].map(cell => Number(cell.dataset.value))))"
    )
    assert len(cells) == 20
    for taken, (total,), spent, (again,), _ in cells:
        assert sum(taken) == pytest.approx(total, abs=1e-6)
        assert sum(spent) == pytest.approx(again, abs=1e-6) and total == again
