"""``open``: the report, up to date, in the browser."""

import webbrowser

from pneucli import messages
from pneucli.cli import console
from pneucli.cli.command import Command, File, HowToRun

HELP = "Bring the report up to date and open it in the browser."


def _open(pipeline: File, how: HowToRun = HowToRun()) -> None:
    opened_pipeline = how.open(pipeline)
    done = how.update(opened_pipeline, "report")
    report = opened_pipeline.artifacts / "report" / "report.html"
    shown = webbrowser.open(report.as_uri())
    if how.json:
        console.print_json({"schema": "pneucli/open/1", "report": str(report), "opened": shown})
    else:
        if how.verbose:
            console.print_text(messages.render("report", done["report"].answer, str(pipeline), verbose=True))
        console.print_text(str(report) if shown else f"no browser was found; the report is {report}")


COMMAND = Command(_open, "pneucli open axis-7/pipeline.toml", HELP, place=170)
