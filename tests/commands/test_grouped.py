"""`--help` in groups: every command has its place and an example that the command line understands."""

import shlex

import pytest
import typer
from typer.testing import CliRunner

from hevopt.cli import application
from hevopt.commands.grouped import EXAMPLES, GROUPS

COMMANDS = typer.main.get_command(application())


def test_the_commands_are_listed_in_groups_with_an_example_each():
    out = CliRunner().invoke(application(), ["--help"], terminal_width=100).output
    places = [out.index(f"{group.title}:") for group in GROUPS]
    assert places == sorted(places) and "Commands:" not in out
    for group in GROUPS:
        first = next(iter(group.examples))
        assert group.examples[first] in out
    assert set(EXAMPLES) == set(COMMANDS.commands) and "More:" not in out
    for name in COMMANDS.commands:
        assert f"\n  {name} " in out


@pytest.mark.parametrize("name", EXAMPLES)
def test_a_command_comes_alone_where_it_is_named_first(name):
    alone = typer.main.get_command(application([name, "--help"])).commands

    assert list(alone) == [name]
    assert [p.name for p in alone[name].params] == [p.name for p in COMMANDS.commands[name].params]
    for words in ([], ["--help", name], ["--version"], [f"{name}s!"]):
        assert (
            typer.main.get_command(application(words)).commands.keys() == COMMANDS.commands.keys()
        )


@pytest.mark.parametrize("name", EXAMPLES)
def test_an_example_is_understood_by_its_command(name):
    words = shlex.split(EXAMPLES[name])
    assert words[:2] == ["hevopt", name]
    command, rest = COMMANDS.commands[name], words[2:]
    while rest and rest[0] in getattr(command, "commands", {}):
        command, rest = command.commands[rest[0]], rest[1:]
    # Raises for an option that is none, a value of another kind, or an argument that lacks.
    command.make_context(name, list(rest))


def test_options_are_listed_by_what_they_are_about():
    out = CliRunner().invoke(application(), ["compare", "--help"], terminal_width=100).output
    titles = [
        "Arguments:",
        "Options:",
        "Files to write:",
        "On the page:",
        "How it is solved:",
        "Changes of the cars:",
        "Example:",
    ]
    assert all(f"\n{title}" in out for title in titles)
    part = {title: out.split(f"\n{title}")[1].split("\n\n")[0] for title in titles}
    assert "--out-steps" in part["Files to write:"] and "--fronts" in part["On the page:"]
    assert "--refine" in part["How it is solved:"] and "--mass" in part["Changes of the cars:"]
    assert "hevopt compare --cycle nedc" in part["Example:"]
    every = [o for p in COMMANDS.commands["compare"].params for o in p.opts if o.startswith("--")]
    assert len(every) > 25 and all(option in out for option in every)
