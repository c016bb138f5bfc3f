"""``ingest``: raw files to checked signals."""

from pneucli.cli.command import stage_command

COMMAND = stage_command("ingest", "pneucli ingest axis-7/pipeline.toml", place=20)
