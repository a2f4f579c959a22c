"""What a worker makes of a job, and the keys that results are stored under."""

import pytest

from hevopt import load_architecture, load_cycle
from hevopt.errors import SolverError, UnknownNoxError
from hevopt.files.lookup import shipped_folder
from hevopt.studies.case import prepare
from hevopt.studies.rows import Row
from hevopt.studies.settings import Settings
from hevopt.studies.solved import run_case
from hevopt.sweeps.plan.jobs import FIGURES, Job, Task, jobs_of
from hevopt.sweeps.workers.work import run_job

CHANGES = {"battery.cells_in_series": 48, "machine.power_max_w": 14e3}


def one_job(strategies=("ecms", "dp", "bound"), weights=(0.0, 10.0), **settings):
    members = list(enumerate(weights))
    ((job, planned),) = jobs_of("C2", ["nedc"], strategies, [(CHANGES, members)], **settings)
    return job, planned


def test_a_job_gives_the_rows_that_a_comparison_would():
    outcomes = list(run_job(one_job()[0]))
    assert [o.ending for o in outcomes] == ["ok"] * 6
    case = prepare(load_architecture("C2", CHANGES), load_cycle("nedc"), Settings(nox_weight=10.0))
    row, _, trajectory = run_case(case, "ecms")
    stored = next(o.row for o in outcomes[3:] if o.row["strategy"] == "ecms")
    assert {k: v for k, v in stored.items() if k in row.as_dict()} == {
        k: v for k, v in row.as_dict().items() if k != "solve_s"
    }
    assert set(stored) == (set(Row.__dataclass_fields__) - {"solve_s"}) | set(FIGURES)
    # By hand: weighted cost less the worth of what the charge has gained, as a volume.
    gained_j = trajectory.end_j - case.problem.start_j
    cost_kg = trajectory.total_fuel_kg + 10 * trajectory.total_nox_kg
    corrected_kg = cost_kg - case.certificate.price_kgpj * gained_j
    litres = corrected_kg / 0.835 / case.cycle.distance_m * 1e5
    assert stored["objective_l_per_100km"] == pytest.approx(litres, rel=1e-12)
    # The row's own bound is for its end charge; that of the objective is corrected as the objective is.
    worth = row.fuel_l_per_100km - row.fuel_corrected_l_per_100km
    corrected = row.bound_l_per_100km - worth
    assert stored["objective_bound_l_per_100km"] == pytest.approx(corrected, rel=1e-12)
    assert stored["objective_bound_l_per_100km"] <= stored["objective_l_per_100km"]


def test_no_objective_lies_below_the_bound_that_pruning_uses():
    outcomes = list(run_job(one_job(("bound", "ecms", "dp", "conventional"))[0]))
    for rows in (outcomes[:4], outcomes[4:]):
        bound = rows[0].row["bound_l_per_100km"]
        objectives = [o.row["objective_l_per_100km"] for o in rows[1:]]
        assert rows[0].row["fuel_l_per_100km"] is None
        assert bound <= min(objectives) < 1.01 * bound


def test_a_key_says_everything_that_can_change_a_result_and_nothing_else():
    _, planned = one_job()
    keys = {p.key for p in planned}
    assert len(keys) == len(planned) == 6
    assert keys == {p.key for p in one_job()[1]}
    assert not keys & {p.key for p in one_job(allow_shortfall=True)[1]}
    other = next(jobs_of("C2", ["udds"], ["dp"], [(CHANGES, [(0, 0.0)])]))[1]
    # The file's own value, given once more, and a text that changes no result.
    written = dict(CHANGES, hybrid_mass_kg=70, description="another")
    same = next(jobs_of("C2", ["nedc"], ["dp"], [(written, [(7, 0)])]))[1]
    assert other[0].key not in keys and same[0].key in keys


def test_what_a_strategy_learns_from_is_in_its_key_and_in_no_other(monkeypatch):
    def keys():
        jobs = jobs_of("C2", ["nedc"], ["sdp", "dp", "bound"], [({}, [(0, 0.0)])])
        return {planned.strategy: planned.key for planned in next(jobs)[1]}

    before = keys()
    monkeypatch.setattr("hevopt.sweeps.plan.jobs.shipped_cycles", lambda: [load_cycle("udds")])
    after = keys()
    assert {name for name in before if before[name] != after[name]} == {"sdp"}


def test_a_copy_of_a_shipped_cycle_teaches_no_more_than_the_cycle_itself(
    tmp_path, quick, beginnings
):
    (tmp_path / "mine.csv").write_bytes((beginnings / "hwfet.csv").read_bytes())
    rows = []
    for cycle in ("hwfet", str(tmp_path / "mine.csv")):
        ((job, planned),) = jobs_of("C2", [cycle], ["sdp"], [({}, [(0, 0.0)])])
        rows.append((planned[0].key, next(run_job(job)).row))
    # One drive under two names: one key, and so it must be one result.
    assert rows[0] == rows[1]


def test_a_weight_on_unknown_nox_is_found_before_anything_runs(tmp_path):
    engine = shipped_folder("architectures") / "components/engine_diesel_1600.toml"
    without = engine.read_text().split("[nox_coefficients]")[0]
    (tmp_path / "engine.toml").write_text(without)
    changes = {"engine": str(tmp_path / "engine.toml")}
    with pytest.raises(UnknownNoxError, match="nox_weight 5 needs NOx data"):
        list(jobs_of("C2", ["nedc"], ["dp"], [(changes, [(0, 0.0), (1, 5.0)])]))
    assert list(jobs_of("C2", ["nedc"], ["dp"], [(changes, [(0, 0.0)])]))


def test_an_exception_is_an_outcome_and_the_other_cases_go_on():
    job, _ = one_job(("dp", "baseline"), (0.0,))
    impossible = Job(job.architecture, job.changes, "us06", False, job.cases)
    broken = Job(job.architecture, {"machine.power_max_w": -1}, "nedc", False, job.cases)

    class Guard:
        def __enter__(self):
            raise SolverError("not today")

        def __exit__(self, *_):
            return False

    assert {o.ending for o in run_job(job)} == {"ok"}
    guarded = run_job(job, Guard)
    assert [(o.ending, str(o.failure)) for o in guarded] == [("failed", "not today")] * 2
    assert [o.ending for o in run_job(broken)] == ["failed"] * 2
    weak = Job("A", {}, "us06", False, (Task("k", 0.0, "baseline"),))
    (outcome,) = run_job(weak)
    assert outcome.ending == "infeasible" and "Nm missing" in str(outcome.failure)
    assert {o.ending for o in run_job(impossible)} <= {"ok", "infeasible", "failed"}


def test_a_file_that_changes_while_a_sweep_runs_fails_its_cases(tmp_path):
    cycle = tmp_path / "drive.csv"
    cycle.write_text("time_s,speed_kmh\n0,0\n10,36\n20,36\n30,0\n")
    ((job, _),) = jobs_of("C2", [str(cycle)], ["dp"], [({}, [(0, 0.0)])])
    assert next(run_job(job)).ending == "ok"
    cycle.write_text("time_s,speed_kmh\n0,0\n10,40\n20,36\n30,0\n")
    (outcome,) = run_job(job)
    assert outcome.ending == "failed" and "changed after the sweep began" in str(outcome.failure)


def test_a_bound_says_where_the_cycle_is_not_followed():
    ((job, _),) = jobs_of("A", ["us06"], ["bound"], [({}, [(0, 0.0)])], allow_shortfall=True)
    assert "shortfall at" in next(run_job(job)).row["status"]
