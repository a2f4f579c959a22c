"""Kinds of coupling written out as parts: the same driveline, read back."""

import pytest

from hevopt import DataError, load_architecture
from hevopt.car_files.template import new_files

KINDS = (
    "B", "C1", "C2", "p0_p4_diesel", "prius_1998", "series_1500", "series_parallel_1500", "electric_compact"
)  # fmt: skip


def written(path, like):
    (target, text), *_ = new_files("mine", like, path / "mine.toml", parts=True).items()
    target.write_text(text)
    return load_architecture(target)


@pytest.mark.parametrize("like", KINDS)
def test_parts_say_what_a_kind_stands_for(tmp_path, like):
    own, line = written(tmp_path, like).driveline, load_architecture(like).driveline
    assert own.kind == "parts" != line.kind
    assert own.parts == line.parts
    assert (own.engine, own.machines) == (line.engine, line.machines)
    assert (own.free_engine_speed, own.follows_load) == (line.free_engine_speed, line.follows_load)


def test_parts_are_written_as_parts_again(tmp_path):
    first = written(tmp_path, "prius_1998")
    (path, text), *_ = new_files("again", first.source, tmp_path / "again.toml", parts=True).items()
    path.write_text(text)
    assert load_architecture(path).driveline == first.driveline


@pytest.mark.parametrize(
    ("like", "words"),
    [("A", "follows the electric load"), ("E", "odd gears has some of the gears only"),
     ("D", "machine gear is uncoupled above a speed")],
)  # fmt: skip
def test_what_parts_cannot_say_is_a_message(tmp_path, like, words):
    with pytest.raises(DataError, match=words):
        written(tmp_path, like)
