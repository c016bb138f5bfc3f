"""Whether a model serves the purpose of its user."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import asdict
from typing import Any

from pneucli.compare import ChannelResult
from pneucli.compare.purpose import assess_purpose
from pneucli.config.stage_tables import Channel


def purpose_answer(results: Sequence[ChannelResult], tolerances: Mapping[Channel, float]) -> dict[str, Any] | None:
    """Return whether the model serves its user, as JSON has it; None where no channel can tell."""
    found = assess_purpose(results, {str(channel): limit for channel, limit in tolerances.items()})
    return None if found is None else {"adequate": found.adequate, "worst": asdict(found.worst)}
