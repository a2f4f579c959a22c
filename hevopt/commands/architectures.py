"""`hevopt architectures new` and `schema`, `hevopt validate`: files of one's own."""

import shlex
from pathlib import Path
from typing import Annotated

import typer

from hevopt.commands.listing import architectures_app
from hevopt.commands.terminal import listed, write
from hevopt.errors import DataError


@architectures_app.command("new")
def new(
    name: Annotated[str, typer.Argument(help="Name of the architecture, and of its file.")],
    like: Annotated[str, typer.Option("--like", help="Name or file of the one to start from.")],
    out: Annotated[
        Path | None, typer.Option("--out", help="The file to write (default NAME.toml).")
    ] = None,
    components: Annotated[
        str | None,
        typer.Option(
            "--components",
            help="Components to get as files of their own, in components/ beside it: names of car, "
            "engine, gearbox, machine, battery, separated by commas, or all.",
        ),
    ] = None,
    parts: Annotated[
        bool, typer.Option("--parts", help="Write the coupling out, part by part.")
    ] = False,
) -> None:
    """Write a commented architecture to edit, with the same results as the one it is like."""
    from hevopt.car_files.template import new_files
    from hevopt.files.shown import encodable
    from hevopt.files.writing import check_writable, note_asked, write_whole

    files = new_files(name, like, out, listed(components) or (), parts=parts)
    check_writable(list(files)[-1])
    for path in files:
        note_asked(path)
    for path, text in files.items():
        if path.parent.name == "components":
            path.parent.mkdir(exist_ok=True)
        write_whole(path, encodable(text).encode())
        write(f"written: {path}")
    write(f"next: edit, then  hevopt validate {shlex.quote(str(list(files)[-1]))}")


@architectures_app.command("schema")
def schema(
    kind: Annotated[
        str | None,
        typer.Argument(help="architecture, car, engine, gearbox, machine or battery; all if none."),
    ] = None,
) -> None:
    """Print the JSON Schema of architecture and component files."""
    import json

    from hevopt.car_files import schema as file_schema

    write(json.dumps(file_schema.schema(kind), indent=1, ensure_ascii=False))


def validate(
    files: Annotated[
        list[str],
        typer.Argument(
            metavar="FILE...",
            help="Architectures, components, cycles, study files of compare and sweep.",
        ),
    ],
) -> None:
    """Check files in full: every fault of all of them at once, with key, value and allowed range."""
    from hevopt.checks.validate import validate
    from hevopt.files.shown import printable

    findings = [validate(name) for name in files]
    seen: set[str] = set()
    for finding in findings:
        if not finding.faults:
            write(f"{finding.path}: ok, {finding.kind} {printable(finding.about)}".rstrip())
            continue
        several = "s" if finding.count > 1 else ""
        write(f"{printable(str(finding.path))}: {finding.kind}, {finding.count} fault{several}")
        fresh = [fault for fault in finding.faults if fault not in seen]
        for fault in fresh:
            write(f"  {fault}")
        if finding.advice and fresh:
            write(f"  {finding.advice}")
        if len(fresh) < len(finding.faults):
            write(f"  listed above: {len(finding.faults) - len(fresh)}")
        seen |= set(fresh)
    if seen:
        raise typer.Exit(DataError.exit_status)
