"""The judgement of a model's error in the JSON answers of ``compare`` and ``diagnose``."""

from __future__ import annotations

from typing import Any

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
        "worst": None
        if worst is None
        else {"recording": worst.recording, "channel": worst.channel, "ratio_to_noise": worst.ratio_to_noise},
        "balance": None
        if balance is None
        else {"subsystem": balance.kind.title, "channel": balance.channel, "times_noise": balance.ratio},
    }
