"""What the program said when it was stored: ``stored/COMMAND.json`` holds calls, their answers, and the words.

``python -m tests.messages.stored_calls`` stores what is said now.
"""

import json
from collections.abc import Callable, Mapping, Sequence
from dataclasses import make_dataclass
from importlib import import_module
from inspect import signature
from pathlib import Path
from types import GeneratorType
from typing import Any, get_type_hints

from pneucli.figure import read, to_json
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
    """Call as stored, with typed arguments; texts of several lines become lists of them."""
    module, _, path = call["call"].rpartition(".") if call["call"].islower() else call["call"].partition(".")
    *owner, name = path.split(".")
    arguments = [answer(command, one) for one in call["with"]]
    holder: Any = import_module(f"pneucli.messages.{module}".rstrip("."))
    if owner:
        holder = read(getattr(holder, owner[0]), arguments.pop(0))
    words = getattr(holder, name)
    if callable(words):
        words = words(**typed(words, arguments, call.get("options", {})))
    if isinstance(words, Finding):
        words = words.text
    if isinstance(words, GeneratorType):
        words = list(words)
    return words.split("\n") if isinstance(words, str) and "\n" in words else to_json(words)


def typed(function: Callable[..., Any], arguments: Sequence[Any], options: Mapping[str, Any]) -> dict[str, Any]:
    """Return the arguments by their names, those that are answers as what the function takes."""
    given = dict(zip(signature(function).parameters, arguments, strict=False)) | options
    hints = {name: kind for name, kind in get_type_hints(function).items() if name in given}
    return vars(read(make_dataclass("Arguments", hints.items()), given))


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
