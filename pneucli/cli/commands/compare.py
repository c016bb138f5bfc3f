"""``compare``: the model against the recordings."""

from pneucli.cli.command import stage_command

COMMAND = stage_command("compare", "pneucli compare axis-7/pipeline.toml -v", place=40)
