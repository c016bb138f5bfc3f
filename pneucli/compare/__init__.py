"""Compare a model with recordings: its errors, those of a correct model, and the regions of large errors."""

from pneucli.compare.channel_errors import Comparison, compare, overall_error
from pneucli.compare.error_regions import find_error_regions
from pneucli.messages.compare import ChannelResult, Region

__all__ = ["ChannelResult", "Comparison", "Region", "compare", "find_error_regions", "overall_error"]
