"""Model against recordings: how much they differ, against what a correct model would show, and where."""

from __future__ import annotations

from pneucli.compare.channel_errors import ChannelResult, Comparison, compare, overall_error
from pneucli.compare.error_regions import Region, find_error_regions

__all__ = ["ChannelResult", "Comparison", "Region", "compare", "find_error_regions", "overall_error"]
