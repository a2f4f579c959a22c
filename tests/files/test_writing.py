"""Files written at once: whole or not at all, and nothing of a killed run stays."""

import os
import signal
import subprocess
import sys

import pytest

from hevopt.errors import DataError
from hevopt.files.writing import clear_leftovers, temporary_folder, write_whole

KILLED = """
import os, signal, sys
from pathlib import Path
from hevopt.files import writing
os.fsync = lambda descriptor: os.kill(os.getpid(), signal.SIGKILL)
writing.write_whole(Path(sys.argv[1]), b"half")
"""


def test_what_a_killed_run_has_left_goes_with_the_next_write(tmp_path):
    out = tmp_path / "out.csv"
    out.write_bytes(b"old")
    done = subprocess.run([sys.executable, "-c", KILLED, str(out)], stderr=subprocess.PIPE)
    assert done.returncode == -signal.SIGKILL, done.stderr
    left = {p.name for p in tmp_path.iterdir()} - {"out.csv"}
    assert len(left) == 1 and out.read_bytes() == b"old"
    write_whole(tmp_path / "other.csv", b"new")
    assert {p.name for p in tmp_path.iterdir()} == {"out.csv", "other.csv"}


def test_what_is_held_and_what_is_no_temporary_file_stays(tmp_path, monkeypatch):
    monkeypatch.setattr("tempfile.tempdir", str(tmp_path))
    kept = [tmp_path / name for name in (".hevopt.toml", ".hevopt.ABCDEFGH", ".hevopt.abcd_1234")]
    for file in kept:
        file.touch()
    (tmp_path / ".hevopt.abcd_123").mkdir()
    (tmp_path / ".hevopt.abcd_123" / "store").touch()
    os.mkfifo(tmp_path / ".hevopt.abcd_124")
    (tmp_path / ".hevopt.abcd_125").symlink_to(kept[0])
    with temporary_folder() as folder:
        clear_leftovers(tmp_path)
        write_whole(tmp_path / "out.csv", b"new")
        there = {
            *kept,
            folder,
            tmp_path / "out.csv",
            tmp_path / ".hevopt.abcd_124",
            tmp_path / ".hevopt.abcd_125",
        }
        assert set(tmp_path.iterdir()) == there
    assert set(tmp_path.iterdir()) == there - {folder}


def test_a_write_that_fails_leaves_nothing(tmp_path, monkeypatch):
    def full(_):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(os, "fsync", full)
    with pytest.raises(DataError, match="No space left"):
        write_whole(tmp_path / "out.csv", b"new")
    assert not list(tmp_path.iterdir())
