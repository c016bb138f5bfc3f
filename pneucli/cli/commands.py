"""The commands of this installation."""

from __future__ import annotations

from importlib import import_module
from pathlib import Path
from typing import Any

import typer

from pneucli.pipeline.graph import STAGES, Stage
from pneucli.version import __version__

HELP = """From recordings of a servo-pneumatic axis to valve maps, friction models, the missing physical effect, and a
validated controller."""
# commands that are no stage, or more than their stage, in the order of --help; "init" comes before the stages
_OTHERS = ("plan", "add", "remove", "history", "diff", "plot", "run", "open", "check", "status", "effects", "exam")
OTHER_COMMANDS = ("init", *_OTHERS, "fleet", "schema", "explain")
MODULES = {name: name for name in OTHER_COMMANDS} | {"add": "edit", "remove": "edit"}
FLAGS = ("help", "install_completion", "show_completion")
EXIT_CODES = "Exit codes: 0 done; 1 done, and a check of [checks] failed; 2 the input is at fault; 3 the program is."


def build(command: str = "") -> typer.Typer:
    """Return the program: with one command, or with all of this installation where none has that name."""
    commands = _commands()
    # with these defaults typer does not load pydantic
    defaults = dict.fromkeys(FLAGS, False) | {name: {"help": False} for name in commands}
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
    for register in dict.fromkeys([commands[command]] if command in commands else commands.values()):
        module, _, stage = register.partition(":")
        arguments = (STAGES[stage],) if stage else ()
        import_module(f"pneucli.cli.{module}").register(app, *arguments)
    for registered in app.registered_commands:
        registered.short_help = registered.help  # else the list of commands cuts it
    return app


def _commands() -> dict[str, str]:
    """Return the module of each command, in the order of ``--help``: ``"run"``, or ``"stage:NAME"``."""
    stages = {one.name: f"stage:{one.name}" for one in STAGES.values() if one.built and one.name not in MODULES}
    first = {"init": "init"} if Stage("init", "").built else {}
    return first | stages | {name: module for name, module in MODULES.items() if name != "init"}


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
