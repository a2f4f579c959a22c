"""The notebooks in examples/, run from top to bottom: python tests/notebooks.py writes their outputs anew.

What is written does not tell when or where it was run: no times, no folders, no versions.
"""

import os
import sys
import tempfile
from pathlib import Path

import nbformat
from nbclient import NotebookClient

FOLDER = Path(__file__).resolve().parents[1] / "examples"
NOTEBOOKS = tuple(sorted(FOLDER.glob("*.ipynb")))


def executed(path: Path) -> nbformat.NotebookNode:
    """A notebook with the outputs that it has now; an error of a cell is raised."""
    notebook = nbformat.read(path, as_version=4)
    with tempfile.TemporaryDirectory() as folder:
        client = NotebookClient(
            notebook,
            timeout=600,
            kernel_name="python3",
            record_timing=False,
            resources={"metadata": {"path": folder}},
        )
        # A kernel draws into the notebook, whatever whoever runs this draws on.
        drawn = {k: v for k, v in os.environ.items() if k != "MPLBACKEND"}
        client.execute(env=drawn)
    notebook.metadata["language_info"] = {"name": "python"}
    return notebook


def _main() -> None:
    for path in NOTEBOOKS:
        notebook = executed(path)
        nbformat.write(notebook, path)
        print(f"{path.name}: {path.stat().st_size / 1e3:.0f} kB", file=sys.stderr)


if __name__ == "__main__":
    _main()
