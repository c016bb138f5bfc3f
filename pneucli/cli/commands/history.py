"""``history``: the errors of every model that was compared, oldest first."""

from __future__ import annotations

from pneucli.cli import console
from pneucli.cli.command import Command
from pneucli.cli.options import File, Json, Out, Quiet, Verbose, open_pipeline_file

HELP = "How the error fell: every model that was compared, oldest first; nothing is run."


def _history(
    pipeline: File, out: Out = None, json: Json = False, verbose: Verbose = False, quiet: Quiet = False
) -> None:
    from pneucli.messages import history
    from pneucli.stages.history import history_answer

    opened_pipeline = open_pipeline_file(pipeline, out)
    opened_pipeline.validate()
    models = history_answer(opened_pipeline.artifacts / "compare")
    if json:
        console.print_json({"schema": "pneucli/history/1", "pipeline": opened_pipeline.name, "models": models})
        return
    console.print_text("\n".join(history.lines(models, str(pipeline), verbose)))
    if models and opened_pipeline.stage_status(["compare"])["compare"].reasons and not quiet:
        console.print_message(f"the file or its data have changed since; to compare anew: pneucli compare {pipeline}")


COMMAND = Command(_history, "pneucli history axis-7/pipeline.toml", HELP, place=130)
