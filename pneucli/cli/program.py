"""The commands of this installation."""

import importlib
import importlib.util
import pkgutil
from pathlib import Path
from typing import Any

import typer

from pneucli import imports
from pneucli.cli import commands, console
from pneucli.cli.command import Command, with_common_options
from pneucli.errors import InputError
from pneucli.version import __version__

HELP = """From recordings of a servo-pneumatic axis to valve maps, friction models, the missing physical effect, and a
validated controller."""
FLAGS = ("help", "install_completion", "show_completion")
EXIT_CODES = "Exit codes: 0 done; 1 done, and a check of [checks] failed; 2 the input is at fault; 3 the program is."


def build(command: str = "") -> typer.Typer:
    """Return the program: with one command, or with all of this installation where none has that name."""
    shown = {command: found} if (found := _own_command(command)) else _all_commands()
    # with these defaults typer does not load pydantic
    defaults = dict.fromkeys(FLAGS, False) | {name: {"help": False} for name in shown}
    app = typer.Typer(
        name="pneucli",
        help=HELP,
        epilog=EXIT_CODES,
        no_args_is_help=True,
        add_completion=True,
        pretty_exceptions_enable=False,
        rich_markup_mode=None,
        context_settings={"help_option_names": ["-h", "--help"], "default_map": defaults},
    )
    app.callback()(_common)
    for name, one in shown.items():
        app.command(name, help=one.text, short_help=one.text, epilog=f"Example: {one.example}")(
            with_common_options(one.run)
        )
    return app


def _own_command(name: str) -> Command | None:
    """Return a command of this program, whose file has its name; None where there is none."""
    module = f"{commands.__name__}.{name}"
    if not name.isidentifier() or importlib.util.find_spec(module) is None:
        return None
    found: Command = importlib.import_module(module).COMMAND
    return found


def _all_commands() -> dict[str, Command]:
    """Return all commands by name: those of this program in their order, then those of other packages."""
    own = {one.name: _own_command(one.name) for one in pkgutil.iter_modules(commands.__path__)}
    found = {name: command for name, command in own.items() if command is not None}
    return dict(sorted((_others() | found).items(), key=lambda item: item[1].place))


def _others() -> dict[str, Command]:
    """Return the commands of other packages; one that cannot be loaded is left out, and said on standard error."""
    found = {}
    for name, one in imports.entry_points(imports.COMMANDS).items():
        try:
            found[name] = imports.load(one)
        except InputError as error:
            console.print_message(f"left out: {error}")
    return found


class _PathParameter:
    """Reads a path of the command line; typer's own reader loads pydantic, which takes a tenth of a second."""

    @staticmethod
    def coerce(value: Any, **_: Any) -> Path | None:
        """Return the value as a path."""
        return None if value is None else Path(value)


def as_command(app: typer.Typer) -> Any:
    """Return the program as a callable command that reads paths without pydantic."""
    program: Any = typer.main.get_command(app)
    for one in program.commands.values():
        for parameter in one.params:
            if getattr(getattr(parameter, "type_descriptor", None), "annotation", None) is Path:
                parameter._runtime_param = _PathParameter
    return program


def _version(wanted: bool) -> None:
    if wanted:
        typer.echo(f"pneucli {__version__}")
        raise typer.Exit


def _common(
    version: bool = typer.Option(False, "--version", "-V", callback=_version, is_eager=True, help="Print the version."),
    debug: bool = typer.Option(False, "--debug", help="Show the traceback of a fault of the program."),
) -> None:
    """Declare ``--debug``; it works anywhere on the line, because ``main`` removes it."""
