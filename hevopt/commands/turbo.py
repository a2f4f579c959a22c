"""`hevopt engine full-load` and `hevopt tipin`: the engine beyond its map."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

import typer

from hevopt.commands.options import JsonOption
from hevopt.commands.reporting import check_ending, check_page
from hevopt.commands.terminal import Progress, show, write
from hevopt.errors import DataError

if TYPE_CHECKING:
    from hevopt.tipin.drive import Manoeuvre
    from hevopt.tipin.study import TipInStudy

engine_app = typer.Typer(help="The engine beyond its map.", rich_markup_mode=None)


@engine_app.callback()
def _engine() -> None:
    """The engine beyond its map."""


@engine_app.command("full-load")
def full_load(
    engine: Annotated[
        str, typer.Argument(help="Name or file of an engine with a [mean_value] part.")
    ] = "engine_diesel_1300",
    plot: Annotated[
        Path | None, typer.Option("--plot", help="Draw the curve to this PNG file.")
    ] = None,
) -> None:
    """The torque that full pedal settles to at each speed of the file's curve, with pressures and air."""
    from hevopt.files.lookup import find
    from hevopt.files.writing import check_outs, write_whole
    from hevopt.output import full_load as output
    from hevopt.tipin.study import settled_full_load

    if plot is not None:
        check_ending("--plot", plot, ".png")
        check_outs({"--plot": plot}, [find("architectures/components", engine, ".toml")])
    with Progress() as progress:
        found, known = settled_full_load(engine, progress)
    show(output.full_load_table(found, known))
    write(output.NOTES)
    if plot is not None:
        write_whole(plot, output.full_load_figure(found, known))
        write(f"plot written to {plot}")


def tipin(
    car: Annotated[
        str, typer.Argument(help="Name or TOML file of an architecture.")
    ] = "compact_1300",
    speed_kmh: Annotated[float, typer.Option("--from", help="Constant speed before, km/h.")] = 40.0,
    gear: Annotated[int, typer.Option("--gear", help="Gear engaged.")] = 4,
    smoke: Annotated[
        str | None,
        typer.Option("--smoke", help="Least lambda of the smoke limit, such as 1.1,1.25,1.4."),
    ] = None,
    turbo_inertia: Annotated[
        str | None,
        typer.Option("--turbo-inertia", help="Factors of the turbocharger's inertia: 0.5,2."),
    ] = None,
    final_drive: Annotated[
        str | None, typer.Option("--final-drive", help="Final drive ratios, such as 3.2,4.3.")
    ] = None,
    gear_ratio: Annotated[
        str | None,
        typer.Option("--gear-ratio", help="Ratios of the gear engaged, such as 0.9,1.1."),
    ] = None,
    egr: Annotated[
        str | None,
        typer.Option("--egr", help="Factors of the recirculation valve's opening; 0: closed."),
    ] = None,
    e_boost: Annotated[
        bool, typer.Option("--e-boost", help="One more case: the car's machine fills the hole.")
    ] = False,
    integrator: Annotated[
        Literal["rk4", "lsoda"],
        typer.Option(
            "--integrator", help="rk4 with a fixed step, or lsoda, which chooses its own."
        ),
    ] = "rk4",
    step_ms: Annotated[
        float | None, typer.Option("--step", help="Step of rk4, ms (0.25 without this).")
    ] = None,
    changes: Annotated[
        list[str] | None,
        typer.Option(
            "--set",
            metavar="KEY=VALUE",
            help="Any key of the car by its path, such as engine.mean_value.exhaust_wall.gas_wpk=0; repeatable.",
        ),
    ] = None,
    json: JsonOption = False,
    report: Annotated[
        Path | None, typer.Option("--report", help="Write a page to this HTML file.")
    ] = None,
) -> None:
    """The pedal to the floor at constant speed: mean-value engine beside steady map, and what changes it.

    Each list gives cases of its own, laid over the car as it is.
    """
    from hevopt.mean_value.run import STEP_S
    from hevopt.studies.study_file import assignments
    from hevopt.tipin.study import cases_of, manoeuvre_of, study_of

    if step_ms is not None and integrator == "lsoda":
        raise DataError(
            "--step is of rk4; lsoda chooses its own: leave one of --step and --integrator out"
        )
    step_s = STEP_S if step_ms is None else step_ms / 1e3
    lists = {
        "smoke": smoke, "turbo_inertia": turbo_inertia, "final_drive": final_drive,
        "gear_ratio": gear_ratio, "egr": egr,
    }  # fmt: skip
    manoeuvre = manoeuvre_of(
        car, speed_kmh / 3.6, gear, integrator=integrator, step_s=step_s,
        changes=assignments(changes or []),
    )  # fmt: skip
    values = {name: _numbers(f"--{name.replace('_', '-')}", text) for name, text in lists.items()}
    if report is not None:
        _check_page(report, manoeuvre)
    with Progress() as progress:
        study = study_of(manoeuvre, cases_of(values, e_boost), progress)
    if json:
        _print_json(study)
    else:
        _print(study)
    if report is not None:
        _write_page(report, study)
    if study.failed:
        raise typer.Exit(4)


def _numbers(option: str, text: str | None) -> list[float]:
    from hevopt.files.shown import shown

    try:
        return [] if text is None else [float(part) for part in text.split(",")]
    except ValueError:
        raise DataError(
            f"{option} {shown(text)}; needed: numbers separated by commas, such as 0.5,1,2"
        ) from None


def _print(study: "TipInStudy") -> None:
    from hevopt.output import tipin_tables as tables
    from hevopt.tipin.drive import inertia_said, titled

    found = study.found
    show(tables.feel_table(found, titled(study.manoeuvre)))
    show(tables.engine_table(found))
    if any(tip_in.assist for tip_in in found):
        show(tables.assist_table(found))
    write(tables.start_text(found[0]))
    if said := inertia_said(study.manoeuvre):
        write(said)
    write(tables.notes(found))
    for label, error in study.failed.items():
        write(f"{label}: {error}")


def _print_json(study: "TipInStudy") -> None:
    from json import dumps

    from hevopt.output.tipin_tables import as_dict

    told: dict[str, Any] = {"cases": [as_dict(tip_in) for tip_in in study.found]}
    told["failed"] = {label: str(error) for label, error in study.failed.items()}
    write(dumps(told, indent=1, allow_nan=False))


def _check_page(report: Path, manoeuvre: "Manoeuvre") -> None:
    from hevopt.files.writing import check_outs

    check_page(report)
    check_outs({"--report": report}, manoeuvre.architecture.files)


def _write_page(report: Path, study: "TipInStudy") -> None:
    import shlex
    import sys

    from hevopt.files.writing import write_whole
    from hevopt.pages.tipin.page import tipin_page
    from hevopt.tipin.bands import bands_of

    manoeuvre, found = study.manoeuvre, study.found
    command = shlex.join(["hevopt", *sys.argv[1:]])
    bands = bands_of(manoeuvre, found[0].figures)
    page = tipin_page(manoeuvre, found, study.failed, bands, command)
    write_whole(report, page.encode())
    write(f"page written to {report}")
