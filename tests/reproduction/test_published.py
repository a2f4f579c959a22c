"""The published figures stand beside the study's own cars and cycle, and beside no others."""

from pathlib import Path

from hevopt.files.lookup import shipped_folder
from hevopt.pages.comparison.saved import load_results


def test_published_figures_are_not_set_beside_changed_cars(hevopt):
    assert "published" in hevopt("compare", "--architectures", "A,B")[1]
    assert "published" not in hevopt("compare", "--architectures", "A,B", "--mass", "1400")[1]


def test_published_figures_are_not_set_beside_cars_and_cycles_that_only_bear_the_studys_names(
    hevopt,
):
    lines = (shipped_folder("cycles") / "nedc.csv").read_text().splitlines()
    head = sum(not line[:1].isdigit() for line in lines)
    Path("nedc.csv").write_text("\n".join(lines[: head + 201]) + "\n")
    _, out, _ = hevopt("compare", "--architectures", "A,B", "--cycle", "./nedc.csv")
    assert "cycle nedc" in out and "published" not in out
    own = (shipped_folder("architectures") / "B.toml").read_text()
    Path("B.toml").write_text(own.replace("hybrid_mass_kg = 10", "hybrid_mass_kg = 11"))
    _, out, _ = hevopt("compare", "--architectures", "A,./B.toml", "--save", "saved.gz")
    assert "A baseline" in out and "published" not in out
    assert load_results(Path("saved.gz")).published == []


def test_published_figures_stand_beside_copies_of_the_studys_files(hevopt):
    """What decides is what the files say; a car of another name is no matter."""
    for kind, name in (("cycles", "nedc.csv"), ("architectures", "B.toml")):
        Path(name).write_text((shipped_folder(kind) / name).read_text())
    own = Path("B.toml").read_text()
    Path("mine.toml").write_text(own.replace('name = "B"', 'name = "mine"').replace("= 10", "= 11"))
    cars = "A,./B.toml,./mine.toml"
    _, out, _ = hevopt(
        "compare", "--architectures", cars, "--cycle", "./nedc.csv", "--save", "s.gz"
    )
    assert "published" in out and load_results(Path("s.gz")).published
