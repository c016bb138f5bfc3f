"""Print answers on standard output; :mod:`pneucli.notebook.progress` prints everything else on standard error."""

import json
from collections.abc import Mapping
from typing import Any

from pneucli.errors import InputError, printable
from pneucli.notebook.progress import discard_output, ignore_message, print_message, progress
from pneucli.paths import from_here

__all__ = ["discard_output", "ignore_message", "print_error", "print_json", "print_message", "print_text", "progress"]


def print_text(text: str) -> None:
    """Print an answer for people; control characters in names are escaped, paths start from where the user stands."""
    print(from_here(printable(text, keep="\n")))


def print_json(content: Mapping[str, Any]) -> None:
    """Print the one JSON object of ``--json``."""
    print(json.dumps(content, indent=1, allow_nan=False))


def print_error(error: InputError) -> None:
    """Print an error as the one JSON object of ``--json``."""
    parts = {key: getattr(error, key) for key in ("where", "found", "wanted", "mend", "code")}
    print_json({"schema": "pneucli/error/1", "error": parts, "exit_code": error.exit_code})
