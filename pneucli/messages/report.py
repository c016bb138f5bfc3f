"""Where the report is."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any

from pneucli.messages import labelled
from pneucli.messages.formatting import join_names


def lines(answer: Mapping[str, Any], file: str, verbose: bool) -> Iterator[str]:
    """Yield the files, the checks that failed, and how to look at them."""
    page, *others = answer["files"]
    yield from labelled("wrote", f"report/{page} ({answer['bytes'] / 1e6:.1f} MB), {', '.join(others)}")
    if failed := [c["path"] for c in answer["checks"] if not c["passed"]]:
        yield from labelled("failed", f"checks: {join_names(failed)}")
    yield from labelled("do", f"pneucli open {file}")
