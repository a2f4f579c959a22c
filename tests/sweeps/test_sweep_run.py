"""From study to store: each case once, whatever is there; the same rows whoever ran them; pruning; memory."""

import hashlib
import json
import os
import subprocess
import sys
from contextlib import contextmanager, nullcontext
from pathlib import Path
from pkgutil import resolve_name
from random import Random

import pytest
from sweep_runs import check_sound, stored, sweep_here, table, write_study

import hevopt
from hevopt.errors import DataError
from hevopt.sweeps.estimate import timed_sample
from hevopt.sweeps.plan.prune import WAVES
from hevopt.sweeps.plan.study_file import read_study
from hevopt.sweeps.run import Execution, Onlookers, Stopped, plan_of
from hevopt.sweeps.store.ranking import best_designs
from hevopt.sweeps.store.reading import open_to_read
from hevopt.sweeps.workers.work import run_job

REAL = "hevopt.sweeps.workers.work:run_job"


@pytest.fixture
def here(monkeypatch):
    """Work is done in this process, as if by workers whose answers come in any order."""

    @contextmanager
    def workers(terms, **options):
        work = resolve_name(terms.work)

        def run(jobs):
            shuffled = list(jobs)
            Random(options["count"]).shuffle(shuffled)
            for job in shuffled:
                yield work(job, nullcontext)

        yield run

    monkeypatch.setattr("hevopt.sweeps.run.workers", workers)


def test_the_store_has_to_the_last_bit_what_the_jobs_give_here(tmp_path):
    study = write_study(tmp_path, 2, 2, ("ecms", "dp", "bound"))
    progress = sweep_here(study, tmp_path / "s.sqlite", REAL, workers=2)
    assert (progress.done, progress.total, progress.failed) == (24, 24, 0)
    plan = plan_of(read_study(study))
    here = {o.key: o for job in plan.jobs for o in run_job(job, nullcontext)}
    keys = {(case.design, case.strategy): case.key for case in plan.planned}
    with open_to_read(tmp_path / "s.sqlite") as reader:
        records = list(reader.records())
    assert len(records) == 24 == len(here)
    for record in records:
        outcome = here[keys[record.design, record.strategy]]
        assert (record.ending, record.row, record.failure) == (outcome.ending, outcome.row, None)


def test_only_what_is_missing_is_run_and_failures_only_when_asked(tmp_path, monkeypatch, here):
    asked = tmp_path / "fail"
    monkeypatch.setenv("SWEEP_FAILS", str(asked))
    asked.touch()
    study, store = write_study(tmp_path, 6, 5), tmp_path / "s.sqlite"
    first = sweep_here(study, store, "fails_when_asked", workers=1)
    assert first.done == 60 and 0 < first.failed < 60
    asked.unlink()
    assert sweep_here(study, store, "fails_when_asked", workers=1).done == 0
    again = sweep_here(study, store, "fails_when_asked", workers=1, retry_failed=True)
    assert (again.done, again.failed) == (first.failed, 0)
    wider = sweep_here(write_study(tmp_path, 6, 6), store, "fails_when_asked", workers=1)
    # Of 6 powers between the same ends only the ends were among the 5.
    assert wider.done == 72 - 24
    check_sound(store)


def test_a_run_that_is_stopped_keeps_what_it_had_and_goes_on_from_there(tmp_path):
    study, store = write_study(tmp_path, 6, 10), tmp_path / "s.sqlite"
    seen = []
    watch = Onlookers(progress=lambda p: seen.append(p.done), stop=lambda: seen[-1] >= 20)
    with pytest.raises(Stopped):
        sweep_here(study, store, "slow", workers=2, watch=watch)
    assert 20 <= seen[-1] == stored(store) < 120
    assert sweep_here(study, store, "work", workers=2).done == 120 - seen[-1]
    assert stored(store) == 120


def test_pruning_finds_the_same_best_designs_and_condemns_only_worse_ones(tmp_path, here):
    study = write_study(tmp_path, 17, 10)
    stores = {name: tmp_path / f"{name}.sqlite" for name in ("full", "one", "two")}
    sweep_here(study, stores["full"], "landscape", workers=1)
    for name, count in (("one", 1), ("two", 2)):
        progress = sweep_here(study, stores[name], "landscape", workers=count, prune=True)
        assert progress.pruned > 100 and progress.done == progress.total
    assert table(stores["one"]) == table(stores["two"])
    with open_to_read(stores["full"]) as full, open_to_read(stores["one"]) as short:
        best, best_short = best_designs(full, 1), best_designs(short, 1)
        objectives = {r.design: r.row["objective_l_per_100km"] for r in full.records()}
        pruned, counts = short.pruned(), short.counts()
    assert [d[0].design for d in best.values()] == [d[0].design for d in best_short.values()]
    assert len(best) == 2
    for found in pruned:
        assert objectives[found.design] >= found.bound > found.objective
        assert objectives[found.incumbent] == found.objective
    assert counts["pruned"] == len(pruned) and counts["missing"] == 0
    # What is left to solve begins with a wave for each weight.
    assert counts["ok"] - 340 >= 2 * WAVES[0]


def test_designs_that_do_not_follow_condemn_none_and_rank_after_all_that_do(tmp_path, here):
    study, store = write_study(tmp_path, 5, 4), tmp_path / "s.sqlite"
    sweep_here(study, store, "short_of_torque", workers=1, prune=True)
    with open_to_read(store) as reader:
        best, pruned = best_designs(reader, 40), reader.pruned()
    assert len(best) == 2 and pruned
    for designs in best.values():
        good = [design.follows for design in designs]
        assert good == sorted(good, reverse=True) and not all(good)
        assert designs[0].objective > 4 and designs[-1].objective == 0.1
    short = {d.design for designs in best.values() for d in designs if not d.follows}
    assert not short & {found.incumbent for found in pruned}


def test_what_an_earlier_run_has_solved_is_not_pruned(tmp_path, here):
    study, store = write_study(tmp_path, 5, 4), tmp_path / "s.sqlite"
    sweep_here(study, store, "landscape", workers=1)
    assert sweep_here(study, store, "landscape", workers=1, prune=True).pruned == 0
    with open_to_read(store) as reader:
        assert reader.pruned() == [] and reader.counts()["ok"] == 80


def test_the_table_has_what_is_known_of_a_pruned_design(tmp_path, here):
    study, store = write_study(tmp_path, 17, 10), tmp_path / "s.sqlite"
    sweep_here(study, store, "landscape", workers=1, prune=True)
    head, *lines = table(store)
    lines = [dict(zip(head, line, strict=True)) for line in lines]
    solved = {x["design"]: x for x in lines if (x["outcome"], x["strategy"]) == ("ok", "ecms")}
    pruned = [line for line in lines if line["outcome"] == "pruned"]
    assert pruned and head[-4:-1] == [
        "design_bound_l_per_100km", "incumbent", "incumbent_objective_l_per_100km",
    ]  # fmt: skip
    for line in pruned:
        incumbent = line["incumbent_objective_l_per_100km"]
        assert solved[line["incumbent"]]["objective_l_per_100km"] == incumbent
        assert line["bound_l_per_100km"] == line["design_bound_l_per_100km"]
        assert float(line["design_bound_l_per_100km"]) > float(incumbent)
        assert line["objective_l_per_100km"] == "" and line["incumbent"] != line["design"]
    assert not any(line["incumbent"] for line in solved.values())


def test_a_store_knows_the_versions_and_the_digests_of_all_files_it_came_from(tmp_path, here):
    study, store = write_study(tmp_path, 2, 2), tmp_path / "s.sqlite"
    engines = 'engine = ["engine_diesel_1600", "engine_diesel_1600_steep_nox"]\n'
    study.write_text(study.read_text() + engines)
    sweep_here(study, store, "landscape", workers=1)
    with open_to_read(store) as reader:
        meta = reader.meta()
    inputs = json.loads(meta["inputs"])
    assert json.loads(meta["versions"])["hevopt"] == hevopt.__version__
    stems = {Path(file).stem for file in inputs}
    assert {"C2", "short", "study", "engine_diesel_1600", "engine_diesel_1600_steep_nox"} <= stems
    for file, found in inputs.items():
        assert hashlib.sha256(Path(file).read_bytes()).hexdigest() == found


def test_a_study_whose_designs_share_no_nox_weight_has_nothing_to_prune(tmp_path):
    study = write_study(tmp_path, 2, 2)
    assert plan_of(read_study(study)).prunable
    head = study.read_text().split("battery")[0]
    study.write_text(f"{head}nox_weight = {{ from = 0, to = 9, count = 4 }}\n")
    assert not plan_of(read_study(study)).prunable


def test_pruned_designs_are_solved_after_all_without_pruning(tmp_path, here):
    study, store = write_study(tmp_path, 17, 10), tmp_path / "s.sqlite"
    spared = sweep_here(study, store, "landscape", workers=1, prune=True).pruned
    assert sweep_here(study, store, "landscape", workers=1).done == spared
    sweep_here(study, tmp_path / "full.sqlite", "landscape", workers=1)
    assert table(store) == table(tmp_path / "full.sqlite")


def test_pruning_bounds_alone_is_a_users_mistake(tmp_path):
    with pytest.raises(DataError, match="bounds alone"):
        plan_of(read_study(write_study(tmp_path, strategies=("bound",))), prune=True)


def test_the_sample_for_an_estimate_is_run_and_not_stored(tmp_path):
    plan = plan_of(read_study(write_study(tmp_path, 5, 4)))
    missing = {case.key for case in plan.planned}
    sample = timed_sample(plan, missing, Execution(work="sweep_workers:work"), Onlookers())
    # Five jobs of two cases a millisecond each, out of twenty.
    assert sample.cases == 10 and sample.total_s == pytest.approx(20 * 0.002)
    # A worker's process imports numpy and numba before its first case.
    assert sample.startup_s > 0.1
    assert timed_sample(plan, set(), Execution(), Onlookers()) is None


def test_of_many_nox_weights_the_sample_takes_a_few(tmp_path):
    study = write_study(tmp_path, 5, 4)
    study.write_text(study.read_text().replace("[0, 10]", "{ from = 0, to = 99, count = 100 }"))
    plan = plan_of(read_study(study))
    missing = {case.key for case in plan.planned}
    sample = timed_sample(plan, missing, Execution(work="sweep_workers:work"), Onlookers())
    assert sample.cases == 5 * 3 and sample.total_s == pytest.approx(2000 * 0.001)


def test_planning_tells_how_far_it_is(tmp_path):
    seen = []
    plan = plan_of(
        read_study(write_study(tmp_path, 5, 4)), progress=lambda *count: seen.append(count)
    )
    assert seen == [(n + 1, 20) for n in range(20)] and len(plan.jobs) == 20


ENVIRONMENT = os.environ | {"PYTHONPATH": os.pathsep.join(filter(None, sys.path))}
MEMORY = """
import re, sys
from pathlib import Path
from hevopt.sweeps.plan.jobs import Task, Job, Planned
from hevopt.sweeps.run import Execution, Schedule, Onlookers, run_sweep
from hevopt.sweeps.store.store import open_store
import sweep_workers

def peak_mb():
    # The figure of getrusage would be that of the process that started this one, where that was larger.
    return int(re.search(r"VmHWM:\\s+(\\d+)", Path("/proc/self/status").read_text())[1]) / 1024

count, before = int(sys.argv[2]), peak_mb()
jobs, planned = [], []
for n in range(count // 2):
    cases = [Task(f"{m:064d}", 0.0, s) for m, s in ((2 * n, "dp"), (2 * n + 1, "ecms"))]
    changes = {"battery.cells_in_series": n, "machine.power_max_w": 0.1 * n}
    jobs.append(Job("car", changes, "nedc", False, tuple(cases)))
    planned += [Planned(n, "nedc", case.strategy, 0.0, case.key) for case in cases]
with open_store(Path(sys.argv[1])) as store:
    store.begin({}, ((n, {"a": n}) for n in range(count // 2)), planned)
    execution = Execution(work="sweep_workers:typical")
    progress = run_sweep(Schedule(None, None, jobs, planned), store, execution, watch=Onlookers())
assert progress.done == count
print(before, peak_mb())
"""


def test_the_parent_takes_less_than_three_kilobytes_per_case(tmp_path):
    """So that 100 000 cases stay below 500 MB, of which the libraries take 150."""
    code = [sys.executable, "-c", MEMORY, str(tmp_path / "s.sqlite"), "10000"]
    done = subprocess.run(code, capture_output=True, text=True, env=ENVIRONMENT)
    assert done.returncode == 0, done.stderr
    before, peak = map(float, done.stdout.split())
    assert before < 200
    assert peak - before < 30
    assert stored(tmp_path / "s.sqlite") == 10000
