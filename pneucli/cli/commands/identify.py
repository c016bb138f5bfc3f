"""``identify``: valve map, friction models, parameters."""

from pneucli.cli.command import stage_command

COMMAND = stage_command("identify", "pneucli identify axis-7/pipeline.toml", place=30)
