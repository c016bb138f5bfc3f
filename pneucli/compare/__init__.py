"""Model against recordings: how much they differ, against what a correct model would show, and where."""

from __future__ import annotations

from pneucli.compare.channels import ChannelResult, Comparison, compare, overall_error
from pneucli.compare.where import Region, find_regions

__all__ = ["ChannelResult", "Comparison", "Region", "compare", "find_regions", "overall_error"]
