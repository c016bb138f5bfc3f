"""The commands that this installation has."""

from __future__ import annotations

import typer

from pneucli import __version__
from pneucli.cli import edit, effects, init, run, stage, status
from pneucli.pipeline.graph import STAGES, Stage

app = typer.Typer(
    name="pneucli",
    help="From recordings of a servo-pneumatic axis to valve maps, friction models, the missing physical effect, and a "
    "validated controller.",
    epilog="Exit codes: 0 done; 1 done, and a check of [checks] failed; 2 the input is at fault; 3 the program is.",
    no_args_is_help=True,
    add_completion=False,
    pretty_exceptions_enable=False,
    rich_markup_mode=None,
    context_settings={"help_option_names": ["-h", "--help"]},
)


def _version(wanted: bool) -> None:
    if wanted:
        typer.echo(f"pneucli {__version__}")
        raise typer.Exit


@app.callback()
def _common(
    version: bool = typer.Option(False, "--version", callback=_version, is_eager=True, help="Print the version."),
    debug: bool = typer.Option(False, "--debug", help="Show the traceback of a fault of the program."),
) -> None:
    """Options of the program itself; ``--debug`` works anywhere on the line, :func:`pneucli.cli.main` takes it out."""


if Stage("init", "").built:
    init.register(app)
for _stage in STAGES.values():
    if _stage.built:
        stage.register(app, _stage)
for _command in (edit, run, status, effects):
    _command.register(app)
