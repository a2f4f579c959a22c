"""Pages of the notebooks in examples/, as committed: mkdocs calls this while it collects its files."""

from base64 import b64decode
from pathlib import Path

import nbformat
from mkdocs.config.defaults import MkDocsConfig
from mkdocs.structure.files import File, Files

FOLDER = Path(__file__).resolve().parents[1] / "examples"


def page_of(notebook: nbformat.NotebookNode) -> tuple[str, dict[str, bytes]]:
    """A notebook as Markdown, and its drawings by file name."""
    parts, drawings = [], {}
    for cell in notebook.cells:
        if cell.cell_type != "code":
            parts.append(cell.source)
            continue
        parts.append(f"```python\n{cell.source}\n```")
        for output in cell.outputs:
            data = output.get("data", {})
            if "image/png" in data:
                name = f"{cell.id}.png"
                drawings[name] = b64decode(data["image/png"])
                parts.append(f"![What the cell above draws]({name})")
            elif "text/html" in data:
                # A blank line would end the block in which Markdown leaves HTML alone.
                lines = data["text/html"].splitlines()
                parts.append("\n".join(line for line in lines if line.strip()))
            else:
                parts.append(f"```text\n{output.get('text') or data['text/plain']}\n```")
    return "\n\n".join(parts), drawings


def on_files(files: Files, config: MkDocsConfig) -> Files:
    """Add a page per notebook, with its drawings beside it."""
    for path in sorted(FOLDER.glob("*.ipynb")):
        text, drawings = page_of(nbformat.read(path, as_version=4))
        contents = {f"{path.stem}.md": text, **drawings}
        for name, content in contents.items():
            files.append(File.generated(config, f"notebooks/{name}", content=content))
    return files
