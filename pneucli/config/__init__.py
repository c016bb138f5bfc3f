"""The pipeline file: read, checked as a whole, and edited without losing comments."""

from pneucli.config.load import join_faults, load
from pneucli.config.model import ParameterTable
from pneucli.config.models import CheckTable, PipelineConfig, RecordingTable, SignalTable, WhereTable
from pneucli.config.sources import Source, plugin_files, raw_files, sources

__all__ = [
    "CheckTable",
    "ParameterTable",
    "PipelineConfig",
    "RecordingTable",
    "SignalTable",
    "Source",
    "WhereTable",
    "join_faults",
    "load",
    "plugin_files",
    "raw_files",
    "sources",
]
