"""`--help` in groups: commands by what they are for, options by what they are about, with an example each."""

from collections.abc import Callable, Sequence
from functools import partial
from typing import Any, NamedTuple

from typer.core import TyperCommand, TyperGroup

FILES, PAGE = "Files to write", "On the page"
SOLVING, CAR = "How it is solved", "Changes of the cars"


class HelpGroup(NamedTuple):
    """Commands that belong together: name -> an example of it."""

    title: str
    examples: dict[str, str]


GROUPS: Sequence[HelpGroup] = (
    HelpGroup(
        "Compare and prove",
        {
            "compare": "hevopt compare --cycle nedc --report nedc.html",
            "run": "hevopt run C2 --strategy conventional",
            "table": "hevopt table C2 --cycle nedc --out c2_nedc.npz",
            "strategies": "hevopt strategies",
        },
    ),
    HelpGroup(
        "Drive",
        {
            "drive": "hevopt drive C2 --strategy conventional",
            "performance": "hevopt performance C2",
            "tipin": "hevopt tipin",
            "fmu": "hevopt fmu C2 --out c2.fmu",
        },
    ),
    HelpGroup(
        "Study a car",
        {
            "sweep": "hevopt sweep study.toml",
            "pareto": "hevopt pareto C2",
            "sensitivity": "hevopt sensitivity C2 --strategies dp",
            "size": "hevopt size study.toml",
        },
    ),
    HelpGroup(
        "Read results",
        {
            "report": "hevopt report nedc.json.gz --out nedc.html",
            "reproduction": "hevopt reproduction --out reproduction.md",
            "turbo-lag": "hevopt turbo-lag --out turbo_lag.md",
            "validation": "hevopt validation --out validation.md",
            "scores": "hevopt scores --out scores.md",
        },
    ),
    HelpGroup(
        "Bring your own data",
        {
            "validate": "hevopt validate my_car.toml",
            "architectures": "hevopt architectures",
            "cycles": "hevopt cycles import log.csv --out my_cycle.csv",
            "maps": "hevopt maps import engine.csv --kind engine --out my_engine.toml",
            "engine": "hevopt engine full-load",
            "coastdown": "hevopt coastdown runs.csv --mass-kg 1300",
        },
    ),
)
EXAMPLES = {name: example for group in GROUPS for name, example in group.examples.items()}


class GroupedCommands(TyperGroup):
    """A group whose help lists its commands group by group, the first command's example below each."""

    def get_params(self, ctx: Any) -> list[Any]:
        """The parameters, of which those left out are taken as they are."""
        return _lightly_taken(super().get_params(ctx))

    def format_commands(self, ctx: Any, formatter: Any) -> None:
        """Write the groups; commands of none of them come last."""
        known = {name: command for name, command in self.commands.items() if not command.hidden}
        limit = formatter.width - 6 - max(map(len, known), default=0)
        titles = [
            (group.title, [name for name in group.examples if name in known]) for group in GROUPS
        ]
        rest = [name for name in known if name not in EXAMPLES]
        for title, names in [*titles, ("More", rest)]:
            if not names:
                continue
            rows = [(name, known[name].get_short_help_str(limit)) for name in names]
            if names is not rest:
                rows.append(("e.g.", EXAMPLES[names[0]]))
            with formatter.section(title):
                formatter.write_dl(rows)


class GroupedOptions(TyperCommand):
    """A command whose help lists its options by the group that each names, and ends with an example."""

    def get_params(self, ctx: Any) -> list[Any]:
        """The parameters, of which those left out are taken as they are."""
        return _lightly_taken(super().get_params(ctx))

    def format_options(self, ctx: Any, formatter: Any) -> None:
        """Write arguments, options without a group, then the groups in the order in which they come."""
        groups: dict[str, list[tuple[str, str]]] = {"Arguments": [], "Options": []}
        for parameter in self.get_params(ctx):
            record = parameter.get_help_record(ctx)
            if record is not None:
                plain = "Arguments" if parameter.param_type_name == "argument" else "Options"
                title = getattr(parameter, "rich_help_panel", None) or plain
                groups.setdefault(title, []).append(record)
        for title, rows in groups.items():
            if rows:
                with formatter.section(title):
                    formatter.write_dl(rows)
        if self.name in EXAMPLES:
            with formatter.section("Example"):
                formatter.write_text(EXAMPLES[self.name])


def _lightly_taken(parameters: list[Any]) -> list[Any]:
    """Spare what is left out that which checks values: typer loads pydantic for it, a tenth of a comparison."""
    for parameter in parameters:
        if "process_value" not in vars(parameter):
            parameter.process_value = partial(_taken, parameter, parameter.process_value)
    return parameters


def _taken(parameter: Any, checked: Callable[[Any, Any], Any], ctx: Any, value: Any) -> Any:
    if value is not None or parameter.required:
        return checked(ctx, value)
    nothing = () if parameter.multiple or parameter.nargs == -1 else None
    own = parameter.callback
    return nothing if own is None else own(ctx, parameter, nothing)
