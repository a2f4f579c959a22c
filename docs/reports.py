"""The measured pages of reports/ as pages of the site; mkdocs calls this while it collects its files."""

from pathlib import Path
from typing import Any

from mkdocs.structure.files import File, Files

ROOT = Path(__file__).parents[1]


def on_files(files: Files, config: Any) -> Files:
    """Add every page of reports/, and its pictures, below the same name."""
    for page in sorted([*(ROOT / "reports").rglob("*.md"), *(ROOT / "reports").rglob("*.png")]):
        name = page.relative_to(ROOT).as_posix()
        files.append(File.generated(config, name, abs_src_path=str(page)))
    return files
