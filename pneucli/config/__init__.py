"""The pipeline file: read, checked as a whole, and edited without losing comments."""

from pneucli.config.load import FleetConfig, join_faults, keys_at, line_of, load, load_description, load_fleet, validate
from pneucli.config.pipeline_tables import PipelineConfig, RecordingTable
from pneucli.config.recording_sources import RecordingSource, plugin_files, recording_sources
from pneucli.config.signal_tables import SignalTable, TextTable, WhereTable
from pneucli.config.stage_tables import CheckTable, ParameterTable

__all__ = [
    "CheckTable",
    "FleetConfig",
    "ParameterTable",
    "PipelineConfig",
    "RecordingSource",
    "RecordingTable",
    "SignalTable",
    "TextTable",
    "WhereTable",
    "join_faults",
    "keys_at",
    "line_of",
    "load",
    "load_description",
    "load_fleet",
    "plugin_files",
    "recording_sources",
    "validate",
]
