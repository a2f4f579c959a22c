"""The notebooks in examples/ run from top to bottom and say what they were committed with."""

import re

import nbformat
import pytest
from notebooks import FOLDER, NOTEBOOKS, executed

_NUMBER = re.compile(r"[-+]?\d+(?:\.\d+)?(?:e[-+]?\d+)?")
_PLACES = re.compile(
    r"/(?:home|root|tmp|work|Users|mnt|usr)\b|\b(?:19|20)\d\d-\d\d-\d\d|0x[0-9a-f]{6,}"
)


def said(notebook: nbformat.NotebookNode) -> list[str]:
    """The text of every output, cell by cell, drawings left out."""
    found = []
    for cell in notebook.cells:
        for output in cell.get("outputs", []):
            drawn = "image/png" in output.get("data", {})
            text = output.get("text") or output.get("data", {}).get("text/plain", "")
            found.append("a drawing" if drawn else text)
    return found


def words_and_numbers(text: str) -> tuple[list[str], list[float]]:
    """A text's words, and its numbers apart: another processor may round the last digit otherwise."""
    return _NUMBER.sub("#", text).split(), list(map(float, _NUMBER.findall(text)))


def test_there_is_one_notebook_each_for_engineer_student_and_reviewer():
    assert [path.stem for path in NOTEBOOKS] == ["engineer", "reviewer", "student"]
    assert {path.parent for path in NOTEBOOKS} == {FOLDER}


@pytest.mark.parametrize("path", NOTEBOOKS, ids=lambda path: path.stem)
def test_a_notebook_runs_and_says_what_it_was_committed_with(path):
    committed, now = said(nbformat.read(path, as_version=4)), said(executed(path))
    assert len(now) == len(committed) > 5
    for before, after in zip(committed, now, strict=True):
        (words, numbers), (new_words, new_numbers) = map(words_and_numbers, (before, after))
        assert new_words == words, "python tests/notebooks.py writes the outputs anew"
        assert new_numbers == pytest.approx(numbers, rel=2e-3, abs=2e-3)


@pytest.mark.parametrize("path", NOTEBOOKS, ids=lambda path: path.stem)
def test_a_committed_notebook_is_whole_and_tells_neither_when_nor_where_it_was_run(path):
    notebook = nbformat.read(path, as_version=4)
    cells = [cell for cell in notebook.cells if cell.cell_type == "code"]
    assert [cell.execution_count for cell in cells] == list(range(1, len(cells) + 1))
    assert set(notebook.metadata) == {"kernelspec", "language_info"}
    assert not any(cell.metadata for cell in notebook.cells)
    for output in (output for cell in cells for output in cell.outputs):
        assert output.output_type != "error" and output.get("name") != "stderr"
        texts = [output.get("text", ""), *output.get("data", {}).values()]
        assert not any(_PLACES.search(text) for text in texts if len(text) < 20_000)
    assert path.stat().st_size < 400_000
