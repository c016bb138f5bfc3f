"""Arrow's functions on columns, imported at the first use: that takes longer than the reading of a short file."""

from __future__ import annotations

from typing import Any


def __getattr__(name: str) -> Any:
    from pyarrow import compute  # noqa: PLC0415

    return getattr(compute, name)
