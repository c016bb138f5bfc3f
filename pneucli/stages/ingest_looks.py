"""The part of ``ingest`` that looks at what was read."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import asdict
from typing import Any

from pneucli.config import Source
from pneucli.io.recordings import load_recordings
from pneucli.pipeline.context import Context
from pneucli.plausibility import findings, look, measured


def looked_at(context: Context, sources: Iterable[Source]) -> dict[str, Any]:
    """Return ``looks`` and ``plausibility`` of the answer: what signals look like, and what cannot be true of them."""
    context.progress("looking at what was read", 1.0)
    recordings = load_recordings(context.out)
    looks = {one.name: {name: asdict(look(one, name)) for name in measured(one).signals} for one in recordings}
    stated = {source.name: source.table.constants.keys() for source in sources}
    found = findings(recordings, context.config.to_rig(), stated)
    return {"looks": looks, "plausibility": [asdict(finding) for finding in found]}
