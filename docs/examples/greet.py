"""``greet``: a good morning for a pipeline."""

from pneucli.cli.command import Command, File, How
from pneucli.cli.console import print_json, print_text


def _greet(pipeline: File, how: How = How()) -> None:
    if how.json:
        print_json({"schema": "greeting/1", "pipeline": str(pipeline)})
    else:
        print_text(f"good morning, {pipeline.stem}")


COMMAND = Command(_greet, "pneucli greet axis-7/pipeline.toml", "Says good morning to a pipeline.")
