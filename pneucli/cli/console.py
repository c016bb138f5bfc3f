"""Standard output for answers; standard error, where everything else goes, is :mod:`pneucli.notebook.progress`."""

from __future__ import annotations

import json
from collections.abc import Mapping
from typing import Any

from pneucli.errors import InputError, printable
from pneucli.notebook.progress import hush, progress, say, silence

__all__ = ["answer", "fault", "hush", "progress", "say", "silence", "tell"]


def tell(text: str) -> None:
    """Print an answer for people; control characters that came in with a name are shown, not obeyed."""
    print(printable(text, keep="\n"))


def answer(content: Mapping[str, Any]) -> None:
    """Print the one JSON object of ``--json``."""
    print(json.dumps(content, indent=1, allow_nan=False))


def fault(error: InputError) -> None:
    """Print an error as the one JSON object of ``--json``."""
    parts = {key: getattr(error, key) for key in ("where", "found", "wanted", "mend")}
    answer({"schema": "pneucli/error/1", "error": parts, "exit_code": error.exit_code})
