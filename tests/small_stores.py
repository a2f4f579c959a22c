"""What tests fill a store with: two designs of two strategies, and outcomes of their cases."""

from hevopt.sweeps.plan.jobs import Planned, Result

DESIGNS = [(0, {"a": 0.1, "nox_weight": 0}), (1, {"a": 0.2, "nox_weight": 0})]
PLAN = [Planned(n, "nedc", s, 0.0, f"{n}{s}") for n in (1, 0) for s in ("ecms", "dp")]


def row(figure, strategy="dp"):
    return {"strategy": strategy, "status": "ok", "fuel_l_per_100km": figure, "fuel_corrected_l_per_100km": figure,
            "objective_l_per_100km": figure, "bound_l_per_100km": figure,
            "objective_bound_l_per_100km": figure}  # fmt: skip


def ok(key, figure=1 / 3):
    return Result(key, "ok", row(figure, "ecms" if key.endswith("ecms") else "dp"), None, 0.5)
