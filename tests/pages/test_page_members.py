"""Members of a rule family on a page: marked neutral as rows are, whatever the calibration asks for."""

from hevopt import compare
from hevopt.pages.collect import Collector
from hevopt.rows import NEUTRAL_PERCENT


def test_a_member_is_neutral_where_a_row_would_be():
    collector, taken = Collector(), []

    def observe(case, row, plan, trajectory):
        collector.observe(case, row, plan, trajectory)
        taken.extend(plan.notes["calibration"])

    comparison = compare("nedc", ["E"], ["nox_cut"], observe=observe)
    members = collector.results(comparison, "").rows[0].detail.calibration
    for member, noted in zip(members, taken, strict=True):
        fuel_j = noted["cost_kg"] * 42.9e6
        share = 100 * abs(noted["surplus_j"]) / fuel_j
        assert member.neutral == (noted["inside"] and share <= NEUTRAL_PERCENT)
    assert any(m.neutral and not n["eligible"] for m, n in zip(members, taken, strict=True))
