"""Files that are read: what ends within limits, and how a report names them."""

import os
from pathlib import Path

import pytest

from hevopt.errors import DataError
from hevopt.files.lookup import (
    dumped_json,
    loaded_json,
    place_shown,
    places_shown,
    read_bytes,
    read_text,
    shipped_folder,
    without_folders,
)


def test_a_pipe_a_device_and_a_folder_are_refused_before_they_are_opened(tmp_path):
    os.mkfifo(tmp_path / "pipe")
    for path in (tmp_path / "pipe", Path("/dev/zero"), tmp_path):
        for read in (read_bytes, read_text):
            with pytest.raises(DataError, match="not a regular file"):
                read(path, 1)


def test_a_file_is_read_up_to_the_limit_and_no_further(tmp_path):
    path = tmp_path / "f.csv"
    path.write_bytes(b"x" * 1_000_000)
    assert len(read_bytes(path, 1)) == 1_000_000
    os.truncate(path, 10**12)
    with pytest.raises(DataError, match=r"1000000\.0 MB; allowed: up to 1 MB for a \.csv file"):
        read_bytes(path, 1)


def test_text_is_read_as_before_whatever_its_line_ends_and_mark(tmp_path):
    path = tmp_path / "f.toml"
    path.write_bytes(b"\xef\xbb\xbfa\r\nb\rc\n")
    assert read_text(path, 1) == "a\nb\nc\n"
    path.write_bytes(b"a\xff")
    with pytest.raises(DataError, match="byte 1 is not UTF-8"):
        read_text(path, 1)


def test_a_text_with_half_a_character_is_no_json_and_a_whole_one_is():
    assert loaded_json('"\\ud83d\\ude97"') == "\U0001f697"
    for text in ('"\\ud83d"', '{"\\udead": 1}', "[" * 100_000, "{"):
        with pytest.raises((ValueError, RecursionError)):
            loaded_json(text)


def test_names_that_are_no_utf8_are_saved_as_python_spells_them():
    for text in ("c\udce9.csv", "\U0001f697", "\\udce9"):
        spelt = text.encode("utf-8", "backslashreplace").decode()
        assert loaded_json(dumped_json({text: [text, 1.5]})) == {spelt: [spelt, 1.5]}


def test_a_file_is_named_as_written_and_never_with_folders_above(tmp_path):
    shipped = shipped_folder("cycles") / "nedc.csv"
    assert place_shown(shipped) == "cycles/nedc.csv"
    assert place_shown(Path("../x/c.csv")) == "../x/c.csv"
    assert place_shown(tmp_path / "c.csv") == "c.csv"
    assert place_shown(tmp_path / "x" / "c.csv", tmp_path) == "x/c.csv"


def test_files_of_one_name_are_told_apart_by_as_few_folders_as_will_do():
    paths = [Path(p) for p in ("/a/b/x.toml", "/a/c/x.toml", "/q/b/x.toml", "/z.csv", "x.toml")]
    shown = places_shown(paths)
    assert len(set(shown.values())) == len(paths) and shown[Path("/a/c/x.toml")] == "c/x.toml"
    deep = [Path("/1" + "/d" * 50 + "/x.toml"), Path("/2" + "/d" * 50 + "/x.toml")]
    assert len(set(places_shown(deep).values())) == 2


@pytest.mark.parametrize(
    ("text", "shown"),
    [
        (
            "hevopt sweep /home/me/s.toml --store /x/y.sqlite",
            "hevopt sweep s.toml --store y.sqlite",
        ),
        ("hevopt run '/home/my self/a b.toml'", "hevopt run 'a b.toml'"),
        ("--set 'engine=\"/x/y z/e.toml\"'", "--set 'engine=\"e.toml\"'"),
        ("/home/me/x.toml, with soc: a/b ./c/d ../e/f", "x.toml, with soc: a/b ./c/d ../e/f"),
        ("<b>'x'</b></i> </a></p>", "<b>'x'</b></i> </a></p>"),
        ("5 l/100 km and/or 3 km/h, a / b", "5 l/100 km and/or 3 km/h, a / b"),
    ],
)
def test_texts_lose_folders_and_nothing_else(text, shown):
    assert without_folders(text) == shown
