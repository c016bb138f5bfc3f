"""How the error fell from the first model to the one as it is."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from typing import Any

from pneucli.messages import labelled, table
from pneucli.messages.compare import judged
from pneucli.messages.formatting import joined, times

Model = Mapping[str, Any]
BAR = 24  # characters of the longest bar


def lines(models: Sequence[Model], file: str) -> Iterator[str]:
    """Yield the fall in one line, then every model, oldest first; models on other data in tables of their own."""
    if not models:
        yield from labelled("found", f"no model was compared yet: pneucli compare {file}")
        return
    here = comparable(models)
    yield from labelled("error", fall(here))
    yield from _table(here)
    for data in dict.fromkeys(m["data"] for m in models if m["data"] != here[-1]["data"]):
        yield ""
        yield "on other recordings, or at another horizon; not to be compared with the above:"
        yield from _table([m for m in models if m["data"] == data])


def comparable(models: Sequence[Model]) -> list[Model]:
    """Return the models on the data of the model as it is, oldest first, that one last."""
    now = next((m for m in models if m["current"]), models[-1])
    return [*(m for m in models if m["data"] == now["data"] and m is not now), now]


def fall(models: Sequence[Model]) -> str:
    """Return first and last error of models on the same data, and what was changed between them."""
    first, last = models[0], models[-1]
    use, after = judged(last["error"])
    text = f"{times(first['error'][use])} → {times(after)} × noise" if len(models) > 1 else f"{times(after)} × noise"
    changes = changed(first, last)
    return f"{text} on {use} recordings{f' with {changes}' if changes else ''}"


def changed(first: Model, last: Model) -> str:
    """Return the effects that were added and removed between two models."""
    added, removed = ([n for n in b["effects"] if n not in a["effects"]] for a, b in ((first, last), (last, first)))
    return " ".join(filter(None, [joined(added), f"without {joined(removed)}" if removed else ""]))


def _table(models: Sequence[Model]) -> Iterator[str]:
    use, _ = judged(models[-1]["error"])
    most = max(m["error"][use] or 0.0 for m in models)
    rows = [
        (
            m["when"].replace("T", " ").removesuffix("Z"),
            ", ".join(m["effects"]) or "base model",
            times(m["error"]["test"]),
            times(m["error"]["train"]),
            bar(m["error"][use], most) + (" now" if m["current"] else ""),
        )
        for m in models
    ]
    table_rows = [(*row[:4], row[4].ljust(BAR + 4)) for row in rows]
    yield from table(("when (UTC)", "effects", "test", "train", "error down to 1".ljust(BAR + 4)), table_rows, texts=2)


def bar(error: float | None, most: float) -> str:
    """Return a bar that is as long as the logarithm of the error; none at 1, the noise floor."""
    if error is None or error <= 1.0 or most <= 1.0:
        return ""
    return "#" * max(1, round(BAR * math.log(error) / math.log(most)))
