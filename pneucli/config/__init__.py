"""The pipeline file: read, checked as a whole, and edited without losing comments."""

from pneucli.config.fleet import FleetConfig, load_fleet
from pneucli.config.load import checked, join_faults, keys_at, load
from pneucli.config.model import ParameterTable
from pneucli.config.models import PipelineConfig, RecordingTable, SignalTable, WhereTable
from pneucli.config.sources import Source, plugin_files, raw_files, sources
from pneucli.config.stages import CheckTable
from pneucli.config.texts import TextTable

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
