"""``identify``: valve map, friction models, parameters."""

from __future__ import annotations

from pneucli.cli.command import stage_command

COMMAND = stage_command("identify", "pneucli identify axis-7/pipeline.toml", place=30)
