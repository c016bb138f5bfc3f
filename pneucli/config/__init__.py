"""The pipeline file: read, checked as a whole, and edited without losing comments."""

from pneucli.config.fleet_file import FleetConfig, load_fleet
from pneucli.config.load import checked, join_faults, keys_at, load
from pneucli.config.pipeline_tables import PipelineConfig, RecordingTable, SignalTable, WhereTable
from pneucli.config.recording_sources import Source, plugin_files, raw_files, sources
from pneucli.config.signal_tables import TextTable
from pneucli.config.stage_tables import CheckTable, ParameterTable

__all__ = [
    "CheckTable",
    "FleetConfig",
    "ParameterTable",
    "PipelineConfig",
    "RecordingTable",
    "SignalTable",
    "Source",
    "TextTable",
    "WhereTable",
    "checked",
    "join_faults",
    "keys_at",
    "load",
    "load_fleet",
    "plugin_files",
    "raw_files",
    "sources",
]
