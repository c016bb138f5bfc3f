"""What draws the same every time: then what is drawn can be calculated by hand."""

from collections.abc import Sequence
from typing import Any

import numpy as np


class Chosen:
    """Draws what lies at ``share`` of every range, and of several the first; stands in for a numpy generator."""

    def __init__(self, share: float = 0.6) -> None:
        self.share = share

    def uniform(self, low: float, high: float, size: int | None = None) -> Any:
        value = low + self.share * (high - low)
        return value if size is None else np.full(size, value)

    def random(self) -> float:
        return self.share

    def integers(self, low: int, high: int | None = None) -> int:
        return 0 if high is None else (low + high) // 2

    def choice(self, several: Sequence[Any]) -> Any:
        return several[0]
