"""Panels as bytes: a head of JSON, then the curves in single precision."""

from __future__ import annotations

import json
import struct
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from pneucli.report.page_elements import Panel


def pack(panels: Sequence[Panel], head: Mapping[str, Any]) -> bytes:
    """Return panels in binary: the length of the head, the head as JSON, then each array in single precision.

    The arrays of a panel are its time, from its start, and its curves; NaN is a gap.
    """
    described, arrays = [], []
    for panel in panels:
        start = float(panel.time[0]) if panel.time.size else 0.0
        series = [{"label": one.label, "role": one.role} for one in panel.series]
        described.append(
            {
                "title": panel.title,
                "unit": panel.unit,
                "start": start,
                "restarts": list(panel.restarts),
                "samples": int(panel.time.size),
                "series": series,
            }
        )
        arrays += [panel.time - start, *(one.values for one in panel.series)]
    text = json.dumps({**head, "panels": described}, allow_nan=False).encode()
    text += b" " * (-len(text) % 4)
    return struct.pack("<I", len(text)) + text + b"".join(np.asarray(one, dtype="<f4").tobytes() for one in arrays)
