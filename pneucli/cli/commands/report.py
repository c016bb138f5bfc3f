"""``report``: the page of all answers."""

from __future__ import annotations

from pneucli.cli.command import stage_command

COMMAND = stage_command("report", "pneucli report axis-7/pipeline.toml", place=80)
