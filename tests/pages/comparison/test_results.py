"""The saved form: what goes in comes out, and what is not of its kind is refused with a reason."""

import gzip
import json

import pytest

from hevopt.errors import DataError
from hevopt.pages.comparison.page import comparison_page
from hevopt.pages.comparison.saved import load_results


def test_saved_results_come_back_and_make_the_same_page(nedc, tmp_path):
    path = tmp_path / "results.json.gz"
    path.write_bytes(nedc.results.packed())
    found = load_results(path)
    assert found == nedc.results
    assert comparison_page(found) == nedc.path.read_text(encoding="utf-8")
    path.write_bytes(gzip.decompress(path.read_bytes()))
    assert load_results(path) == nedc.results


def test_rows_are_saved_with_every_digit_of_the_json_output(nedc):
    contents = json.loads(gzip.decompress(nedc.results.packed()))
    assert [row["figures"] for row in contents["rows"]] == nedc.json["rows"]


def test_the_same_results_give_the_same_bytes_at_any_time(nedc, tmp_path, monkeypatch):
    path, packed = tmp_path / "results.json.gz", []
    path.write_bytes(nedc.results.packed())
    for seconds in (1e9, 2e9):
        monkeypatch.setattr("time.time", lambda now=seconds: now)
        found = load_results(path)
        packed.append((found.packed(), comparison_page(found)))
    assert packed[0] == packed[1] and packed[0][0] == path.read_bytes()


def test_inputs_are_the_digests_of_the_files(nedc):
    import hashlib

    from hevopt.files.lookup import shipped_folder

    assert len(nedc.results.inputs) == 16 and "cycles/nedc.csv" in nedc.results.inputs
    root = shipped_folder("cycles").parent
    for name, digest in nedc.results.inputs.items():
        assert hashlib.sha256((root / name).read_bytes()).hexdigest() == digest


def _changed(nedc, change):
    contents = json.loads(nedc.results.model_dump_json())
    change(contents)
    return json.dumps(contents).encode()


@pytest.mark.parametrize(
    ("make", "says"),
    [
        (lambda nedc: b"", "neither JSON"),
        (lambda nedc: b"\x1f\x8bnothing", "neither JSON"),
        (lambda nedc: nedc.results.packed()[:-1000], "cut short"),
        (lambda nedc: b"[" * 100_000, "neither JSON"),
        (lambda nedc: b'{"cycle": "nedc", "rows": []}', "hevopt comparison 2"),
        (lambda nedc: b"\xff\xfe\x00", "neither JSON"),
        (lambda nedc: _changed(nedc, lambda c: c.pop("cars")), "cars: field required"),
        (lambda nedc: _changed(nedc, lambda c: c.update(more=1)), "more: extra"),
        (
            lambda nedc: _changed(nedc, lambda c: c["rows"][3]["figures"].update(gap_percent="<b>")),
            "rows.3.figures.gap_percent",
        ),
        (
            lambda nedc: _changed(nedc, lambda c: c["rows"][3]["figures"].update(gap_percent=-0.007)),
            "rows.3.figures.gap_percent: below 0, a bound above a plan",
        ),
        (
            lambda nedc: _changed(nedc, lambda c: c.update(nox_weight=float("nan"))),
            "nox_weight: input should be a finite number",
        ),
        (
            lambda nedc: _changed(nedc, lambda c: c["rows"][3]["detail"]["trace"]["soc"].pop()),
            "rows.3.detail.trace",
        ),
        (
            lambda nedc: _changed(nedc, lambda c: c["rows"][3]["figures"].update(soc_start=None)),
            "rows.3.figures.soc_start: missing",
        ),
        (
            lambda nedc: _changed(nedc, lambda c: c["cars"].pop("C2")),
            "rows.8.*no car",
        ),
        (
            lambda nedc: _changed(
                nedc, lambda c: c["rows"][3]["figures"].update(architecture="a" * 100_000)
            ),
            "rows.3: no car 'aaa",
        ),
    ],
)  # fmt: skip
def test_a_file_that_is_not_a_saved_comparison_is_refused_with_a_reason(nedc, tmp_path, make, says):
    path = tmp_path / "wrong.json.gz"
    path.write_bytes(make(nedc))
    with pytest.raises(DataError, match=says) as stop:
        load_results(path)
    assert "hevopt compare --save" in str(stop.value) and str(path) in str(stop.value)
    assert len(str(stop.value)) < 2000


def test_a_missing_file_is_named(tmp_path):
    with pytest.raises(DataError, match="cannot be read"):
        load_results(tmp_path / "none.json.gz")
