"""A saved comparison as tables of pandas."""

import pytest
from page_helpers import Made

import hevopt


@pytest.fixture(scope="module")
def made(tmp_path_factory):
    """A comparison of two cars on a short drive, and its saved file."""
    folder = tmp_path_factory.mktemp("saved")
    (folder / "short.csv").write_text("time_s,speed_kmh\n0,0\n5,0\n15,40\n40,40\n50,0\n")
    settings = {"cycle": folder / "short.csv", "architectures": ["A", "C2"]}
    found = Made(folder, "short", **settings, strategies=["baseline", "ecms"])
    path = folder / "short.json.gz"
    path.write_bytes(found.results.packed())
    return found, path


def test_saved_rows_are_those_of_the_comparison(made):
    found, path = made
    frame = hevopt.read_saved(path)
    listed = frame.drop(columns="cycle").astype(object)
    assert listed.where(listed.notna(), None).to_dict("records") == found.json["rows"]
    assert len(frame) == 4 and set(frame["cycle"]) == {"short"}


def test_saved_steps_are_those_that_were_driven(made):
    found, path = made
    frame = hevopt.read_saved_steps(path)
    solved = frame.groupby(["architecture", "strategy"], sort=False)
    assert set(solved.groups) == set(found.solved)
    for key, steps in solved:
        driven = found.solved[key][2].to_frame()
        assert steps["time_s"].tolist() == driven["time_s"].tolist()
        for name in ("soc_start", "soc_end", "fuel_kg", "engine_torque_nm", "machine_gear"):
            assert steps[name].to_numpy() == pytest.approx(driven[name].to_numpy(), abs=2e-3), name
    assert "standing, engine off" in set(frame["operation"])


def test_another_file_is_refused_with_a_reason(tmp_path):
    (tmp_path / "x.json").write_text("{}")
    for read in (hevopt.read_saved, hevopt.read_saved_steps):
        with pytest.raises(hevopt.DataError, match="not in the form"):
            read(str(tmp_path / "x.json"))
