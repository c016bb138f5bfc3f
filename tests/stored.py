"""Stored answers: a text in a file that a person reads, against which a test holds what the program gives now."""

import json
import os
import re
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

NUMBER = re.compile(r"(?<![\w.])[-−]?\d+(?:\.\d+)?(?:e[-+]?\d+)?(?![\w.])")
STORE = "PNEUCLI_STORE"  # where it is set, the files are written anew: look at the difference before it is committed


def hold_against(file: Path, text: str, rel: float = 0.02) -> None:
    """Fail where a text differs from the stored one; numbers may differ by a share ``rel`` of theirs."""
    if STORE in os.environ:
        file.parent.mkdir(exist_ok=True)
        file.write_text(text, encoding="utf-8")
    stored = file.read_text(encoding="utf-8")
    found, wanted = text.splitlines(), stored.splitlines()
    changed = [f"- {b}\n+ {a}" for a, b in zip(found, wanted, strict=False) if not is_like(a, b, rel)]
    changed += [f"+ {line}" for line in found[len(wanted) :]] + [f"- {line}" for line in wanted[len(found) :]]
    if changed:
        pytest.fail(f"{file.name} differs ({STORE}=1 stores it anew):\n" + "\n".join(changed[:40]), pytrace=False)


def hold_rows_against(file: Path, gives: Callable[[dict[str, Any]], Any], rel: float) -> None:
    """Fail where a row of a file, which is a situation, gives something other than is stored under its ``gives``."""
    rows = json.loads(file.read_text(encoding="utf-8"))
    lines = [json.dumps(row | {"gives": gives(row)}, ensure_ascii=False) for row in rows]
    hold_against(file, "[\n " + ",\n ".join(lines) + "\n]\n", rel)


def is_like(text: str, stored: str, rel: float) -> bool:
    """Whether two lines have the same words, and numbers that differ by no more than a share of theirs."""
    if NUMBER.split(text) != NUMBER.split(stored):
        return False
    pairs = [[float(one.replace("−", "-")) for one in NUMBER.findall(line)] for line in (text, stored)]
    return all(a == pytest.approx(b, rel=rel) for a, b in zip(*pairs, strict=True))
