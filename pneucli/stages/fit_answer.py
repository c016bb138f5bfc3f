"""The judgement of a model's error, and its free runs, in the JSON answers of ``compare`` and ``diagnose``."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import asdict
from typing import Any

from pneucli.compare.beyond_fitted import beyond_fitted
from pneucli.compare.channel_errors import ChannelResult, Comparison
from pneucli.compare.free_run import exceeds_limit
from pneucli.compare.goodness_of_fit import GoodnessOfFit
from pneucli.diagnose.adequacy import LackOfFit


def lack_of_fit_answer(judged: GoodnessOfFit | None, balance: LackOfFit | None = None) -> dict[str, Any] | None:
    """Return the entry ``lack_of_fit`` (interface, section 8); None where nothing was compared.

    ``balance`` is the subsystem that errs by more than noise.
    """
    if judged is None:
        return None
    worst = judged.worst
    return {
        "present": judged.lacks or balance is not None,
        "p": judged.p,
        "undetermined": judged.undetermined,
        "use": judged.use,
        "error": judged.error,
        "limit": judged.limit,
        "excused": judged.excused,
        "worst": None
        if worst is None
        else {"recording": worst.recording, "channel": worst.channel, "ratio_to_noise": worst.ratio_to_noise},
        "balance": None
        if balance is None
        else {"subsystem": balance.kind.title, "channel": balance.channel, "times_noise": balance.ratio},
    }


FREE_RUN_KEYS = ("rmsd", "percent", "ratio_to_noise", "ratio_limit")


def free_run_answer(result: ChannelResult) -> dict[str, float | None]:
    """Return the entry ``free_run`` of a channel: its error over the whole recording."""
    values = {key: getattr(result, key) for key in FREE_RUN_KEYS}
    return {key: None if v is None or not math.isfinite(v) else v for key, v in values.items()}


def diverging_answer(found: Sequence[ChannelResult]) -> list[dict[str, Any]]:
    """Return the entry ``free_run`` of an answer: the channels whose error exceeds its limit, the largest first."""
    beyond = sorted(filter(exceeds_limit, found), key=lambda r: -r.rmsd / max(r.measured_range, r.noise))
    return [{"recording": r.recording, "channel": r.channel, "unit": r.unit} | free_run_answer(r) for r in beyond]


def beyond_fitted_answer(comparisons: Sequence[Comparison]) -> dict[str, Any]:
    """Return the entries about held-out samples beyond the range of the fitted recordings."""
    found, within = beyond_fitted(comparisons)
    rows = [{"from" if key == "from_" else key: value for key, value in asdict(one).items()} for one in found]
    return {"beyond_fitted": rows, "error_within_fitted": within}
