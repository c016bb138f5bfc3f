"""``open``: the report, up to date, in the browser."""

from __future__ import annotations

import webbrowser

from pneucli import messages
from pneucli.cli import console
from pneucli.cli.command import Command, update
from pneucli.cli.options import File, Json, Out, Quiet, Verbose, open_pipeline_file

HELP = "Bring the report up to date and open it in the browser."


def _open(pipeline: File, out: Out = None, json: Json = False, verbose: Verbose = False, quiet: Quiet = False) -> None:
    opened_pipeline = open_pipeline_file(pipeline, out)
    done = update(opened_pipeline, ["report"], quiet)
    report = opened_pipeline.artifacts / "report" / "report.html"
    shown = webbrowser.open(report.as_uri())
    if json:
        console.print_json({"schema": "pneucli/open/1", "report": str(report), "opened": shown})
    else:
        if verbose:
            console.print_text(messages.render("report", done["report"].answer, str(pipeline), verbose=True))
        console.print_text(str(report) if shown else f"no browser was found; the report is {report}")


COMMAND = Command(_open, "pneucli open axis-7/pipeline.toml", HELP, place=170)
