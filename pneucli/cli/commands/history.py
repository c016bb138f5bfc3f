"""``history``: the errors of every model that was compared, oldest first."""

from pneucli.cli import console
from pneucli.cli.command import Command, File, HowToRun

HELP = "How the error fell: every model that was compared, oldest first; nothing is run."


def _history(pipeline: File, how: HowToRun = HowToRun()) -> None:
    from pneucli.figure import to_json
    from pneucli.messages import history
    from pneucli.stages.history import compared_models

    opened_pipeline = how.open(pipeline)
    opened_pipeline.validate()
    models = compared_models(opened_pipeline.artifacts / "compare")
    if how.json:
        console.print_json({"schema": "pneucli/history/1", "pipeline": opened_pipeline.name, "models": to_json(models)})
        return
    console.print_text("\n".join(history.lines(models, str(pipeline), how.verbose)))
    if models and opened_pipeline.stage_status(["compare"])["compare"].reasons and not how.quiet:
        console.print_message(f"the file or its data have changed since; to compare anew: pneucli compare {pipeline}")


COMMAND = Command(_history, "pneucli history axis-7/pipeline.toml", HELP, place=130)
