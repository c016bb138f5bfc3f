"""``ingest``: raw files to checked signals."""

from __future__ import annotations

from pneucli.cli.command import stage_command

COMMAND = stage_command("ingest", "pneucli ingest axis-7/pipeline.toml", place=20)
