"""Two rows over each other: the excess of one is that of the trajectories, and an address says what is shown."""

import numpy as np
import pytest
from page_helpers import until

from hevopt.problem.battery import energy_j

EXCESS = """() => {
  const line = document.getElementById('traces')._fullData.find(t => t.name === 'excess cost');
  return [[...line.x], [...line.y]];
}"""


def index_of(nedc, car, strategy):
    names = [(row.figures.architecture, row.figures.strategy) for row in nedc.results.rows]
    return str(names.index((car, strategy)))


def spent_g(nedc, car, strategy):
    """Fuel so far less what the energy stored is worth, from the trajectory itself."""
    case, _, trajectory = nedc.solved[car, strategy]
    stored_j = energy_j(case.problem.battery, trajectory.soc)
    burnt_kg = np.concatenate([[0.0], np.cumsum(trajectory.fuel_kg)])
    return 1e3 * (burnt_kg - case.certificate.price_kgpj * (stored_j - stored_j[0]))


@pytest.fixture
def laid(nedc, shown):
    """C2 by its rule, its optimum laid under it by the button; afterwards one row alone again."""
    page = shown.page
    page.select_option("#row", index_of(nedc, "C2", "conventional"))
    page.click("#optimum")
    yield page
    page.select_option("#over", "-1")
    page.click("#whole")


def test_excess_cost_is_that_of_the_trajectories_at_the_optimums_price(nedc, laid):
    at_s, excess_g = map(np.array, laid.evaluate(EXCESS))
    expected = spent_g(nedc, "C2", "conventional") - spent_g(nedc, "C2", "dp")
    assert np.abs(excess_g - expected).max() < 1e-3 and excess_g[-1] > 1
    case = nedc.solved["C2", "dp"][0]
    km, kgpl = case.cycle.distance_m / 1e3, case.car.engine.fuel_density_kgpm3 / 1e3
    corrected = [
        row.figures.fuel_corrected_l_per_100km for row in nedc.results.rows
        if row.figures.architecture == "C2" and row.figures.strategy in ("conventional", "dp")
    ]  # fmt: skip
    assert excess_g[-1] == pytest.approx(
        (corrected[0] - corrected[1]) * km / 100 * kgpl * 1e3, abs=2e-3
    )
    lost = [
        np.interp(t + 40, at_s, excess_g) - g
        for t, g in zip(at_s, excess_g, strict=True)
        if t + 40 <= at_s[-1]
    ]
    start = at_s[int(np.argmax(lost))]
    said = laid.locator("#over-facts").inner_text()
    assert f"C2 conventional costs {excess_g[-1]:.2f} g more than C2 dp" in said
    assert f"worst 40 s: {start:.0f} to {start + 40:.0f} s, {max(lost):.2f} g" in said
    laid.click("#worst")
    shown_s = [float(laid.input_value(end)) for end in ("#from", "#to")]
    assert shown_s == [start, start + 40]
    # The mark lies there, and the points are those of this window, of both rows.
    shape = laid.evaluate("document.getElementById('traces').layout.shapes[0]")
    assert [shape["x0"], shape["x1"]] == shown_s
    symbols = laid.evaluate(
        "document.getElementById('engine-efficiency')._fullData.slice(-2).map(t => t.marker.symbol)"
    )
    assert symbols == ["circle-open", "circle"]


def test_the_other_row_lies_under_traces_and_beside_the_energy(nedc, laid):
    names = laid.evaluate("document.getElementById('traces')._fullData.map(t => t.name)")
    assert names.index("SOC, C2 dp") < names.index("SOC") and "speed, C2 dp" not in names
    soc = laid.evaluate(
        "document.getElementById('traces')._fullData.find(t => t.name === 'SOC, C2 dp').y"
    )
    assert list(soc) == pytest.approx(list(100 * nedc.solved["C2", "dp"][2].soc), abs=1e-4)
    bars = laid.evaluate(
        "(({ x, y }) => [[...y], [...x]])(document.getElementById('flow-apart').data[0])"
    )
    drawn = dict(zip(*bars, strict=True))
    steps = nedc.solved["C2", "dp"][0].problem.table.step_s
    heat = [
        float(((f["fuel_power_w"] - np.maximum(f["engine_torque_nm"] * f["engine_speed_radps"], 0)) * steps).sum())
        for f in (nedc.solved["C2", s][2].flows for s in ("conventional", "dp"))
    ]  # fmt: skip
    assert drawn["Engine heat"] == pytest.approx((heat[0] - heat[1]) / 1e3, abs=0.1)
    labels = laid.locator("#sankey .flow-label").all_text_contents()
    assert any(text.startswith("Engine heat") and "(+" in text for text in labels)


def test_the_address_says_what_is_shown_and_shows_what_it_says(nedc, laid):
    laid.fill("#from", "100.5")
    laid.fill("#to", "180")
    laid.press("#to", "Enter")
    assert laid.evaluate("location.hash") == "#row=C2+conventional&over=C2+dp&from=100.5&to=180"
    laid.evaluate("location.hash = '#row=E+ecms&over=A+baseline&from=7&to=70'")
    until(laid, "document.querySelector('#h-row .chosen-name').textContent === 'E ecms'")
    assert laid.input_value("#over") == index_of(nedc, "A", "baseline")
    assert [laid.input_value(end) for end in ("#from", "#to")] == ["7", "70"]
    for wrong in ("#table", "#row=nobody", "#row=E+ecms&over=E+ecms&from=x"):
        laid.evaluate(f"location.hash = '{wrong}'")
        laid.wait_for_timeout(50)
        assert laid.locator("#h-row .chosen-name").inner_text() == "E ecms"
    assert laid.input_value("#over") == "-1" and not laid.is_visible("#figure-flow-apart")
