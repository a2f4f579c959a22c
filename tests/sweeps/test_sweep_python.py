"""A sweep as a function of Python: the same store as the command's, and every mistake one message."""

from functools import partial

import pytest
from sweep_runs import sweep_here, write_study

from hevopt import DataError, read_sweep, sweep
from hevopt.sweeps.run import Execution


@pytest.fixture
def stand_in(monkeypatch):
    """Workers that do as they are told in place of solving."""
    stand_ins = partial(Execution, work="sweep_workers:work")
    monkeypatch.setattr("hevopt.sweeps.run.Execution", stand_ins)


def test_it_fills_the_store_that_the_command_would_fill(stand_in, tmp_path):
    study, told = write_study(tmp_path, cells=3, powers=2), []
    found = sweep(study, workers=1, progress=lambda *said: told.append(said))
    assert found.store == tmp_path / "study.sqlite" and found.counts["ok"] == 12
    assert told[-1] == ("0 failed, 0 pruned", 12, 12) and len(told) == len(set(told))
    sweep_here(study, tmp_path / "other.sqlite", workers=1)
    table = found.to_frame()
    assert table.equals(read_sweep(found.store))
    timed = ["case_s"]
    assert table.drop(columns=timed).equals(
        read_sweep(tmp_path / "other.sqlite").drop(columns=timed)
    )
    assert "store='study.sqlite', ok=12" in repr(found)


def test_interrupted_it_goes_on_where_it_was(stand_in, tmp_path):
    study, store = write_study(tmp_path, cells=4, powers=4), tmp_path / "s.sqlite"

    def stop(text, done, total):
        if done:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        sweep(study, store, workers=1, progress=stop)
    assert 0 < (read_sweep(store)["outcome"] == "ok").sum() < 32
    told = []
    assert (
        sweep(study, store, workers=1, progress=lambda *said: told.append(said)).counts["ok"] == 32
    )
    assert told[-1][2] < 32


@pytest.mark.parametrize(
    ("options", "said"),
    [
        ({"workers": 0}, "workers = 0; allowed: 1 to 1e+06"),
        ({"timeout_s": "soon"}, "timeout_s = 'soon'; allowed: 0.001 to 1e+06"),
        ({"memory_mb": float("nan")}, "memory_mb = nan; allowed"),
        ({"backend": "lokey"}, "backend 'lokey'; allowed: loky, dask, ray"),
        ({"scheduler": "tcp://here"}, "loky runs on this machine alone"),
        ({"store": "study.toml"}, "study.toml"),
        ({"study": "nix.toml"}, "nix.toml: cannot be read"),
        ({"study": "wrong.toml"}, "wrong.toml: "),
    ],
)
def test_a_mistake_is_one_message_and_no_store(tmp_path, monkeypatch, options, said):
    monkeypatch.chdir(tmp_path)
    write_study(tmp_path, cells=2, powers=2)
    (tmp_path / "wrong.toml").write_text("architecture = 'C2'\n")
    with pytest.raises(DataError) as error:
        sweep(**({"study": "study.toml"} | options))
    assert said in str(error.value)
    assert not list(tmp_path.glob("*.sqlite"))
