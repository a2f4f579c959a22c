"""Options that several commands take, with one help text each."""

import inspect
from collections.abc import Callable
from typing import Annotated, Any

import typer

from hevopt.commands.grouped import CAR, SOLVING
from hevopt.commands.terminal import listed
from hevopt.errors import DataError
from hevopt.files.shown import shown

_CYCLE = typer.Option("--cycle", help="Name or CSV file of a cycle.")
CycleOption = Annotated[str, _CYCLE]
CycleGivenOption = Annotated[str | None, _CYCLE]
JsonOption = Annotated[bool, typer.Option("--json", help="Print one JSON object instead.")]
WideOption = Annotated[
    bool, typer.Option("--wide", help="Show all columns, however narrow the terminal.")
]
ColdStartOption = Annotated[
    float | None,
    typer.Option(
        "--cold-start",
        metavar="DEG_C",
        help="Tell what every row burns from a start at this temperature, too.",
    ),
]
ArchitectureArgument = Annotated[str, typer.Argument(help="Name or TOML file of an architecture.")]


def _number(option: str, text: str, group: str = CAR) -> Any:
    return Annotated[float | None, typer.Option(option, help=text, rich_help_panel=group)]


def _flag(option: str, text: str) -> Any:
    named = f"--{option}/--no-{option}"
    return Annotated[bool | None, typer.Option(named, help=text, rich_help_panel=SOLVING)]


# Field of studies.settings.Settings -> its option; a test holds the two together.
SETTINGS: dict[str, Any] = {
    "strategies": Annotated[
        str | None,
        typer.Option(
            "--strategies", help="Names, separated by commas, or all.", rich_help_panel=SOLVING
        ),
    ],
    "nox_weight": _number(
        "--nox-weight", "kg of fuel that a kg of NOx counts (ecms, dp, bound).", SOLVING
    ),
    "allow_shortfall": _flag(
        "allow-shortfall", "Drive on where the car cannot follow, and mark the rows."
    ),
    "free_gear": _flag("free-gear", "The engine's gear is a control, not the cycle's."),
    "refine": _flag("refine", "Add torque levels around dp's plan until its cost settles."),
    "horizon_s": _number(
        "--horizon", "Preview of the predictive strategies, s (default 20).", SOLVING
    ),
    "soc_start": _number("--soc-start", "State of charge at the start, 0 to 1."),
    "soc_min": _number("--soc-min", "Lower end of the window of the state of charge."),
    "soc_max": _number("--soc-max", "Upper end of that window."),
    "soc_end": Annotated[
        str | None,
        typer.Option(
            "--soc-end",
            help="Least state of charge at the end: neutral, or 0 to 1.",
            rich_help_panel=CAR,
        ),
    ],
    "auxiliaries_w": _number("--auxiliaries", "Electric load of the on-board network, W."),
    "mass_kg": _number("--mass", "Mass of the car without the parts of the hybrid, kg."),
    "start_cost_g": _number("--start-cost", "Fuel of one engine start, g."),
    "shift_cost_g": _number("--shift-cost", "Fuel that a change of a free gear counts, g."),
    "changes": Annotated[
        list[str] | None,
        typer.Option(
            "--set",
            metavar="KEY=VALUE",
            rich_help_panel=CAR,
            help="Any key of the architecture or of a component by its path, the value as in TOML, such as "
            "machine.power_max_w=2e4 or engine.scale.displacement=1.25; can be repeated.",
        ),
    ],
}


def takes_settings(*without: str) -> Callable[[Callable[..., None]], Callable[..., None]]:
    """Makes a command with an option for every setting but some in place of its parameter `given`.

    given: those that were, as a study file has them
    """
    options = {name: option for name, option in SETTINGS.items() if name not in without}

    def taking(command: Callable[..., None]) -> Callable[..., None]:
        own = inspect.signature(command, eval_str=True).parameters
        parameters = []
        for parameter in own.values():
            kind = inspect.Parameter.KEYWORD_ONLY
            if parameter.name == "given":
                parameters += [
                    inspect.Parameter(name, kind, default=None, annotation=option)
                    for name, option in options.items()
                ]
            else:
                parameters.append(parameter.replace(kind=kind))

        def with_options(**values: Any) -> None:
            given = {name: value for name in options if (value := values.pop(name)) is not None}
            command(given=_as_in_a_file(given), **values)

        with_options.__name__, with_options.__doc__ = command.__name__, command.__doc__
        vars(with_options)["__signature__"] = inspect.Signature(parameters)
        with_options.__annotations__ = {p.name: p.annotation for p in parameters}
        return with_options

    return taking


def _as_in_a_file(given: dict[str, Any]) -> dict[str, Any]:
    values = dict(given)
    if "strategies" in values:
        values["strategies"] = listed(values["strategies"])
    if "changes" in values:
        from hevopt.studies.study_file import assignments

        values["set"] = assignments(values.pop("changes"))
    if "soc_end" in values:
        try:
            values["soc_end"] = float(values["soc_end"])
        except ValueError:
            pass  # a word, which is checked with the others
    return values


def pairs(
    option: str, texts: list[str] | None, roles: tuple[str, ...] | None = None
) -> dict[str, str]:
    """ROLE=VALUE of a repeated option as a mapping; DataError for another form, or a role given twice.

    roles: those allowed, none of which may be left empty; None: whoever uses the mapping knows
    """
    found: dict[str, str] = {}
    for text in texts or []:
        role, equals, value = (part.strip() for part in text.partition("="))
        such = f"such as {option} speed={'NAME' if 'c' in option else 'km/h'}"
        if not equals or (roles is not None and not value):
            raise DataError(f"{option} {shown(text)} is not of the form ROLE=VALUE; {such}")
        if roles is not None and role not in roles:
            raise DataError(
                f"{option} {shown(text)}: no role {shown(role)}; roles: {', '.join(roles)}"
            )
        if role in found:
            raise DataError(f"{option} {shown(text)} gives {role} twice; leave one out")
        found[role] = value
    return found
