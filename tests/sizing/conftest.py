"""Short cycles for all tests of sizing, and sizings run in this process."""

import pytest
from sizing_helpers import CYCLE, HEAD

from hevopt.driving.cycle import load_cycle
from hevopt.sizing.candidates import Candidates
from hevopt.sizing.found import Sizing
from hevopt.sizing.search import is_lattice, search
from hevopt.sizing.size import proven_of
from hevopt.sizing.study_file import read_size_study
from hevopt.sweeps.run import picked
from hevopt.sweeps.store.store import open_store
from hevopt.sweeps.workers.work import run_job

END = 196


@pytest.fixture(scope="session")
def urban_file(tmp_path_factory):
    """The first urban part of the NEDC, its gears listed."""
    lines = load_cycle("nedc")
    path = tmp_path_factory.mktemp("cycle") / "urban.csv"
    rows = ["time_s,speed_kmh,gear,clutch_open"]
    for k in range(END):
        rows.append(
            f"{lines.time_s[k]:g},{3.6 * lines.speed_mps[k]:.9f},{lines.gear[k]},{int(lines.clutch_open[k])}"
        )
    path.write_text("\n".join(rows) + "\n")
    return path


@pytest.fixture(scope="session")
def urban(urban_file):
    return load_cycle(urban_file)


@pytest.fixture
def sized(tmp_path):
    """The text of a study -> what its sizing finds, run in this process."""
    (tmp_path / "short.csv").write_text(CYCLE)

    def size(text: str, name: str = "s", *, head: str = HEAD, proven: bool = False) -> Sizing:
        path = tmp_path / f"{name}.toml"
        path.write_text(head + text)
        study = read_size_study(path)
        with open_store(tmp_path / f"{name}.sqlite") as store:

            def run(jobs, keys):
                for job in picked(jobs, set(keys) - set(store.endings())):
                    store.add(run_job(job))
                store.commit()

            candidates = Candidates(study, store, {}, run)
            search(study, candidates, lambda count: None)
            if proven:
                return proven_of(study, store.path, candidates, lambda count: None)
            return Sizing(study, store.path, is_lattice(study), tuple(candidates.found))

    return size
