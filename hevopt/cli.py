"""Command line: puts the commands together and sets the exit status.

0 ok, 2 bad input, 3 infeasible or solver failure, 4 partly failed sweep.
"""

import atexit
import gc
import os
import sys
from collections.abc import Sequence
from importlib import import_module
from typing import Annotated

import typer

from hevopt import __version__
from hevopt.commands.grouped import GroupedCommands, GroupedOptions
from hevopt.commands.streams import keep_streams
from hevopt.commands.terminal import write
from hevopt.errors import DataError, HevoptError, SolverError, comes_from_interrupt
from hevopt.files.writing import files_told

# Command -> the module of `commands` that it stands in: a function of its name, or an app of commands of its own.
_HOMES = {
    "compare": "solving", "run": "solving", "table": "solving", "drive": "driving", "performance": "driving",
    "fmu": "exporting", "strategies": "listing", "report": "reporting", "validate": "architectures",
    "coastdown": "coasting", "sweep": "sweep", "size": "sizing", "pareto": "studies", "sensitivity": "studies",
    "reproduction": "studies", "turbo-lag": "studies", "validation": "validation", "scores": "scores",
    "tipin": "turbo", "architectures": "architectures", "cycles": "importing", "maps": "mapping", "engine": "turbo",
}  # fmt: skip
_INTERRUPTED = 130
# Objects made before a search for what nobody holds: more than imports make, which stay.
_SEARCHED_AFTER = (300_000, 50, 100)


def _root(
    version: Annotated[bool, typer.Option("--version", help="Print the version and exit.")] = False,
) -> None:
    if version:
        write(f"hevopt {__version__}")
        raise typer.Exit


def application(words: Sequence[str] = ()) -> typer.Typer:
    """The command line, of what is typed: the command that its first word names, or where that is none, all."""
    app = typer.Typer(
        name="hevopt",
        help="How little a hybrid could burn on a driving cycle, how close a strategy comes, and the proof.",
        no_args_is_help=True,
        add_completion=False,
        pretty_exceptions_enable=False,
        rich_markup_mode=None,
        cls=GroupedCommands,
    )
    app.callback(invoke_without_command=True)(_root)
    for name in words[:1] if set(words[:1]) & _HOMES.keys() else _HOMES:
        home, own = import_module(f"hevopt.commands.{_HOMES[name]}"), name.replace("-", "_")
        if group := getattr(home, f"{own}_app", None):
            app.add_typer(group, name=name)
        else:
            app.command(cls=GroupedOptions)(getattr(home, own))
    return app


def main() -> None:
    """Entry point: a user's mistake is one message on stderr and a status, never a traceback."""
    keep_streams()
    gc.set_threshold(*_SEARCHED_AFTER)
    # Or they would be searched at the end, which takes a twentieth of a comparison.
    atexit.register(gc.freeze)
    # Whether a plugin of pydantic is installed, for whatever program, is not looked for among all packages.
    os.environ.setdefault("PYDANTIC_DISABLE_PLUGINS", "__all__")
    with files_told() as files:
        status, message = _status_and_message()
    if status == _INTERRUPTED:
        message = f"interrupted; {files.told()}"
    elif message and files.written:
        message += f"\nhevopt: {files.told()}"
    if message:
        print(f"hevopt: {message}", file=sys.stderr)
    raise SystemExit(status)


def _status_and_message() -> tuple[int, str]:
    try:
        # An int where typer was left by typer.Exit, else what the command returned: None.
        return application(sys.argv[1:])(standalone_mode=False) or 0, ""
    except HevoptError as error:
        return error.exit_status, f"error: {error}"
    except OSError as error:
        return DataError.exit_status, f"error: {error}"
    except UnicodeEncodeError as error:
        name = ascii(error.object[error.start : error.end])
        return (
            DataError.exit_status,
            f"error: a name or text holds {name}, which is not UTF-8; rename the file",
        )
    except MemoryError:
        return SolverError.exit_status, "error: not enough memory; choose a shorter cycle"
    except (KeyboardInterrupt, typer.Abort):
        return _INTERRUPTED, ""
    except SystemError as error:
        # Compiled loops turn an interrupt into this.
        if not comes_from_interrupt(error):
            raise
        return _INTERRUPTED, ""
    except Exception as error:
        # A wrong option or argument: click's class, which typer imports or carries along under its own name.
        if not (hasattr(error, "show") and hasattr(error, "exit_code")):
            raise
        error.show()
        return error.exit_code, ""


if __name__ == "__main__":
    main()
