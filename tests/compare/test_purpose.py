"""Good enough for whom: errors against tolerances, stated or a share of the measured range."""

from __future__ import annotations

import numpy as np
import pytest

from pneucli.compare.channel_errors import DEFAULT_SHARE, ChannelResult, assess_purpose


def result(channel: str, rmsd: float, span: float, use: str = "test", recording: str = "run") -> ChannelResult:
    return ChannelResult(recording, use, channel, "m", rmsd, 1.0, 1.0, 99.0, 1e-6, rmsd / 1e-6, span)


def test_a_stated_tolerance_decides() -> None:
    results = [result("x", 2e-4, 0.1), result("v", 0.01, 1.0)]
    tight, loose = (assess_purpose(results, {"x": x, "v": 0.02}) for x in (1e-4, 3e-4))
    assert tight is not None
    assert loose is not None
    assert (tight.adequate, tight.worst.channel, tight.worst.value, tight.worst.tolerance) == (False, "x", 2e-4, 1e-4)
    assert (loose.adequate, loose.worst.channel) == (True, "x")


def test_without_a_tolerance_a_share_of_the_largest_range_is_taken() -> None:
    results = [result("x", 2e-3, 0.01, recording="short"), result("x", 2e-3, 0.1, recording="long")]
    found = assess_purpose(results, {})
    assert found is not None
    assert found.adequate
    assert found.worst.tolerance == pytest.approx(DEFAULT_SHARE * 0.1)


def test_test_recordings_decide_where_there_are_any() -> None:
    fitted, held_out = result("x", 1e-6, 0.1, use="train"), result("x", 0.09, 0.1)
    alone, both = assess_purpose([fitted], {}), assess_purpose([fitted, held_out], {})
    assert alone is not None
    assert both is not None
    assert alone.adequate
    assert not both.adequate


def test_a_channel_that_never_moves_and_has_no_tolerance_does_not_decide() -> None:
    assert assess_purpose([result("x", 1e-6, 0.0)], {}) is None
    assert assess_purpose([result("x", np.nan, 0.1)], {}) is None
    assert assess_purpose([], {}) is None
