"""What the program said when it was stored: ``stored/COMMAND.json`` holds calls, their answers, and the words.

``python -m tests.messages.stored_calls`` stores what is said now.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from importlib import import_module
from pathlib import Path
from types import GeneratorType
from typing import Any

from pneucli.messages.findings import Finding

FOLDER = Path(__file__).with_name("stored")
Call = Mapping[str, Any]


def stored(command: str) -> dict[str, Any]:
    """Return ``answers`` by name and the ``calls`` of a file."""
    found: dict[str, Any] = json.loads((FOLDER / f"{command}.json").read_text(encoding="utf-8"))
    return found


def answer(command: str, one: Any) -> Any:
    """Return an argument: one ``like`` an answer of its file has the rest of it, but what it is without."""
    if not (isinstance(one, dict) and "like" in one):
        return one
    changes = {key: value for key, value in one.items() if key not in ("like", "without")}
    whole = stored(command)["answers"][one["like"]] | changes
    return {key: value for key, value in whole.items() if key not in one.get("without", [])}


def said(command: str, call: Call) -> Any:
    """Call as stored; texts of several lines become lists of them."""
    module, _, name = call["call"].rpartition(".")
    arguments = [answer(command, one) for one in call["with"]]
    function = getattr(import_module(f"pneucli.messages.{module}".rstrip(".")), name)
    words = function(*arguments, **call.get("options", {}))
    if isinstance(words, Finding):
        words = words.text
    if isinstance(words, GeneratorType):
        words = list(words)
    return words.split("\n") if isinstance(words, str) and "\n" in words else words


def layout(found: Mapping[str, Any]) -> str:
    """Return a file's text: a key of an answer, a key of a call, and a line of what is said on a line each."""

    def lines(key: str, value: Any) -> str:
        many = key == "says" and isinstance(value, list) and len(json.dumps(value)) > 100
        rows = ",".join(f"\n    {json.dumps(one, ensure_ascii=False)}" for one in value) if many else ""
        return f'   "{key}": ' + (f"[{rows}\n   ]" if many else json.dumps(value, ensure_ascii=False))

    def block(one: Mapping[str, Any]) -> str:
        return "{\n" + ",\n".join(lines(key, value) for key, value in one.items()) + "\n  }"

    answers = ",\n".join(f'  "{name}": {block(one)}' for name, one in found["answers"].items())
    calls = ",\n".join(f"  {block(call)}" for call in found["calls"])
    return f'{{\n "answers": {{\n{answers}\n }},\n "calls": [\n{calls}\n ]\n}}\n'


if __name__ == "__main__":  # store what is said now: look at the difference before it is committed
    for path in sorted(FOLDER.glob("*.json")):
        found = stored(path.stem)
        now = [{**call, "says": said(path.stem, call)} for call in found["calls"]]
        path.write_text(layout({**found, "calls": now}), encoding="utf-8")
