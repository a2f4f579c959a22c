"""Writing pages: sizes, the commands, and a file that is never half."""

import json
import re
from html import unescape

import pytest
from command_line import call

from hevopt.files import writing
from hevopt.files.lookup import shipped_folder
from hevopt.pages import render as page

SMALL = ("compare", "--architectures", "A,B")


def test_the_default_page_is_small(nedc):
    assert nedc.path.stat().st_size <= 6e6


def test_the_page_names_no_address_outside_itself(nedc):
    text = nedc.path.read_text(encoding="utf-8")
    text = re.sub(r'<script type="text/plain".*?</script>', "", text, flags=re.DOTALL)
    assert not re.search(r"https?://|//[a-z]+\.|\bon[a-z]+=|@import|url\(", text)
    assert "default-src 'none'" in unescape(text) and "unsafe-eval" not in text
    assert re.findall(r"<(?:link|iframe|img|object|embed|form action)", text) == []


def test_every_script_element_is_ours_or_packed(nedc):
    text = nedc.path.read_text(encoding="utf-8")
    assert len(re.findall(r"<script", text)) == 3 == len(re.findall(r"</script>", text))


def test_compare_writes_page_and_results_and_report_makes_the_same_page(
    monkeypatch, capsys, tmp_path
):
    shown, saved, again = tmp_path / "a b.html", tmp_path / "r.json.gz", tmp_path / "again.html"
    status, out, _ = call(monkeypatch, capsys, *SMALL, "--report", str(shown), "--save", str(saved))
    assert (
        status == 0 and f"report written to {shown}" in out and f"results written to {saved}" in out
    )
    status, out, _ = call(monkeypatch, capsys, "report", str(saved), "--out", str(again))
    assert status == 0 and shown.read_bytes() == again.read_bytes()
    command = "hevopt compare --architectures A,B --report &#39;a b.html&#39; --save r.json.gz"
    assert command in shown.read_text(encoding="utf-8")


def test_json_output_stays_one_object_beside_a_page(monkeypatch, capsys, tmp_path):
    words = (*SMALL, "--json", "--report", str(tmp_path / "p.html"))
    status, out, _ = call(monkeypatch, capsys, *words)
    assert status == 0 and json.loads(out)["cycle"] == "nedc" and (tmp_path / "p.html").exists()


def test_a_page_of_what_failed_is_still_written(monkeypatch, capsys, tmp_path):
    path = tmp_path / "p.html"
    words = ("compare", "--architectures", "A", "--cycle", "us06", "--report", str(path))
    status, _, err = call(monkeypatch, capsys, *words)
    text = path.read_text(encoding="utf-8")
    assert status == 3 and "Nm missing" in err
    assert "No case could be solved" in text and "18 Nm missing" in text


def test_a_cycle_too_long_for_a_page_is_refused_before_solving(monkeypatch, capsys, tmp_path):
    monkeypatch.setattr(
        "hevopt.studies.comparison.compare_cars", lambda *a, **k: pytest.fail("solved first")
    )
    cycle = tmp_path / "long.csv"
    lines = [f"{k / 10},{5 * (0 < k < 20_501)}" for k in range(20_502)]
    cycle.write_text("\n".join(["time_s,speed_kmh", *lines, ""]))
    words = (*SMALL, "--cycle", str(cycle), "--report", str(tmp_path / "p.html"))
    status, _, err = call(monkeypatch, capsys, *words)
    assert status == 2 and "20501 steps" in err and "up to 20000" in err


@pytest.mark.parametrize("option", ["--report", "--save"])
def test_a_place_that_cannot_be_written_is_refused_before_solving(
    monkeypatch, capsys, tmp_path, option
):
    monkeypatch.setattr(
        "hevopt.studies.comparison.compare_cars", lambda *a, **k: pytest.fail("solved first")
    )
    status, _, err = call(monkeypatch, capsys, *SMALL, option, str(tmp_path / "no" / "p.html"))
    assert status == 2 and "No such folder" in err
    cycle = tmp_path / "mine.csv"
    cycle.write_text("time_s,speed_kmh\n0,0\n10,36\n20,36\n30,0\n")
    words = (*SMALL, "--cycle", str(cycle), option, str(cycle))
    status, _, err = call(monkeypatch, capsys, *words)
    assert status == 2 and f"{option} {cycle} is the file" in err


@pytest.mark.parametrize("option", ["--report", "--save"])
def test_a_component_or_a_study_file_is_not_overwritten(monkeypatch, capsys, tmp_path, option):
    monkeypatch.setattr(
        "hevopt.studies.comparison.compare_cars", lambda *a, **k: pytest.fail("solved first")
    )
    car, study = tmp_path / "car.toml", tmp_path / "study.toml"
    car.write_bytes((shipped_folder("architectures") / "components/car_compact.toml").read_bytes())
    study.write_text('architectures = ["A"]\nset = { car = "./car.toml" }\n')
    for path in (car, study):
        before = path.read_bytes()
        status, _, err = call(monkeypatch, capsys, "compare", study, option, path)
        assert status == 2 and "choose another" in err and path.read_bytes() == before


def test_one_file_for_page_and_results_or_for_both_ends_of_report_is_refused(
    monkeypatch, capsys, tmp_path, nedc
):
    path = str(tmp_path / "x")
    status, _, err = call(monkeypatch, capsys, *SMALL, "--report", path, "--save", path)
    assert status == 2 and "choose two" in err
    saved = tmp_path / "r.json.gz"
    saved.write_bytes(nedc.results.packed())
    status, _, err = call(monkeypatch, capsys, "report", str(saved), "--out", str(saved))
    assert status == 2 and "choose another" in err
    assert saved.read_bytes() == nedc.results.packed()


def test_killed_in_the_middle_the_old_page_is_whole(monkeypatch, capsys, tmp_path, nedc):
    saved, path = tmp_path / "r.json.gz", tmp_path / "p.html"
    saved.write_bytes(nedc.results.packed())
    path.write_text("the old page")

    def killed(_):
        raise KeyboardInterrupt

    monkeypatch.setattr(writing.os, "fsync", killed)
    status, _, err = call(monkeypatch, capsys, "report", str(saved), "--out", str(path))
    assert status == 130 and "nothing was written" in err
    assert path.read_text() == "the old page"
    assert sorted(p.name for p in tmp_path.iterdir()) == ["p.html", "r.json.gz"]


@pytest.mark.parametrize(
    ("value", "form", "text"),
    [(None, ".3f", "–"), (-1.25, "+.1f", "−1.2"), (-1e-9, "+.2f", "+0.00"), (-1e-9, ".2f", "0.00"),
     (0.0, "+.1f", "+0.0"), (3, "d", "3")],
)  # fmt: skip
def test_numbers_have_a_true_minus_and_no_negative_zero(value, form, text):
    assert page.fixed(value, form) == text


def test_weights_are_plain_numbers():
    assert page.weights([0.0]) == "0" and page.weights([1570.4]) == "1570"
    assert page.weights([12.54, 1e6, 30.0]) == "12.5 to 1000000"
