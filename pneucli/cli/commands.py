"""The commands of this installation."""

from __future__ import annotations

import typer

from pneucli.cli import (
    check,
    diff,
    edit,
    effects,
    exam,
    explain,
    fleet,
    history,
    init,
    open,
    plan,
    plot,
    run,
    schema,
    stage,
    status,
)
from pneucli.pipeline.graph import STAGES, Stage
from pneucli.version import __version__

HELP = """From recordings of a servo-pneumatic axis to valve maps, friction models, the missing physical effect, and a
validated controller."""
FLAGS = ("help", "install_completion", "show_completion")
EXIT_CODES = "Exit codes: 0 done; 1 done, and a check of [checks] failed; 2 the input is at fault; 3 the program is."


def build() -> typer.Typer:
    """Return the program: a command for each installed stage, and the commands that are no stages."""
    app = typer.Typer(
        name="pneucli",
        help=HELP,
        epilog=EXIT_CODES,
        no_args_is_help=True,
        add_completion=True,
        pretty_exceptions_enable=False,
        rich_markup_mode=None,
        # with these defaults typer does not load pydantic
        context_settings={"help_option_names": ["-h", "--help"], "default_map": dict.fromkeys(FLAGS, False)},
    )
    app.callback()(_common)
    if Stage("init", "").built:
        init.register(app)
    for one in STAGES.values():
        if one.built and one.name != "plan":  # it has more to do than to run the stage
            stage.register(app, one)
    for command in (plan, edit, history, diff, plot, run, open, check, status, effects, exam, fleet, schema, explain):
        command.register(app)
    for registered in app.registered_commands:
        registered.short_help = registered.help  # else the list of commands cuts it
    return app


def _version(wanted: bool) -> None:
    if wanted:
        typer.echo(f"pneucli {__version__}")
        raise typer.Exit


def _common(
    version: bool = typer.Option(False, "--version", "-V", callback=_version, is_eager=True, help="Print the version."),
    debug: bool = typer.Option(False, "--debug", help="Show the traceback of a fault of the program."),
) -> None:
    """Declare ``--debug``; it works anywhere on the line, because ``main`` removes it."""
