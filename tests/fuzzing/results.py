"""Good files that hevopt itself wrote: a saved comparison, packed and plain, and the store of a sweep."""

import gzip
import tempfile
from pathlib import Path

from fuzzing.seed import SHORT_CYCLE, Seed

_STUDY = f"""architecture = "C2"
cycles = ["{SHORT_CYCLE}"]
strategies = ["conventional", "bound"]
allow_shortfall = true
[parameters]
machine.power_max_w = [1e4, 2e4]
engine = ["engine_diesel_1600", "engine_diesel_1600_steep_nox"]
nox_weight = [0, 10]
"""


def results() -> list[Seed]:
    """A saved comparison and a store, each with what reads it."""
    packed = _saved()
    return [
        Seed("saved.json.gz", packed, (("report", "saved.json.gz", "--out", "page.html"),)),
        Seed("saved.json", gzip.decompress(packed), (("report", "saved.json", "--out", "page.html"),)),
        Seed("sweep.sqlite", _store(), (
            ("report", "sweep.sqlite", "--out", "page.html"), ("sweep", "--status", "sweep.sqlite"),
            ("sweep", "--store", "sweep.sqlite", "--export", "cases.csv"),
            ("sweep", "--store", "sweep.sqlite", "--export", "cases.parquet"),
        )),
    ]  # fmt: skip


def _saved() -> bytes:
    from hevopt import compare
    from hevopt.pages.comparison.collect import Collector

    collector = Collector()
    comparison = compare(
        SHORT_CYCLE, ["A", "C2"], ["ecms"], observe=collector.observe, allow_shortfall=True
    )
    return collector.results(comparison, "hevopt compare").packed()


def _store() -> bytes:
    from hevopt.sweeps.plan.jobs import Failure, Result
    from hevopt.sweeps.plan.prune import Pruned
    from hevopt.sweeps.plan.study_file import read_study
    from hevopt.sweeps.run import begin, plan_of
    from hevopt.sweeps.store.store import open_store
    from hevopt.sweeps.workers.work import run_job

    with tempfile.TemporaryDirectory(prefix="hevopt-fuzz-") as name:
        study, path = Path(name) / "sweep.toml", Path(name) / "sweep.sqlite"
        study.write_text(_STUDY)
        plan = plan_of(read_study(study))
        with open_store(path) as store:
            begin(plan, store, "hevopt sweep sweep.toml")
            for job in plan.jobs[:-1]:
                store.add(run_job(job))
            last = plan.jobs[-1]
            store.add(
                [Result(last.cases[0].key, "failed", None, Failure("no such plan\nand why"), 1.0)]
            )
            keys = {case.key for case in last.cases}
            design = max(case.design for case in plan.planned if case.key in keys)
            store.prune([Pruned(design, 9.0, 0, 8.0)])
        return path.read_bytes()
