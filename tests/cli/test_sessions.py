"""What commands print, and their exit codes, as stored: sessions of commands that follow each other in a folder."""

import json
import re
import shlex
import shutil
from pathlib import Path
from typing import Any

import pytest

from tests.cli.conftest import Command
from tests.stored import hold_against

STORED = Path(__file__).parent / "stored"
SESSIONS: dict[str, list[dict[str, Any]]] = json.loads((STORED / "sessions.json").read_text(encoding="utf-8"))
PASSES = (  # what is another one each time
    (r"\d{4}-\d\d-\d\d[T ]\d\d:\d\d:\d\d(\.\d+)?(Z|\+00:00)?", "WHEN"),
    (r"\d+ (effects on|control laws)", r"N \1"),
    (r"about \d+ (s|min)|no estimate yet", "SOON"),
    (r"(ran in|in|took) \d+(\.\d+)? m?s\b", r"\1 SOON"),
    (r'("seconds": )\d+(\.\d+)?(e-\d+)?', r"\1SOON"),
    (r"! Usage: .*\n(! .*\n)+", "! USAGE\n"),  # in the words of the library
    (r"(No such option: --jason)[^\"\[\n]*", r"\1 "),
)


def changed(step: dict[str, Any], folder: Path) -> None:
    """Do to the files what a person does between two commands."""
    for name in step.get("delete", ()):
        (folder / name).unlink()
    for source, target in step.get("copy", {}).items():
        (folder / target).parent.mkdir(exist_ok=True)
        shutil.copy(folder / source, folder / target)
    for name, text in step.get("append", {}).items():
        (folder / name).write_text((folder / name).read_text() + text)
    for name, pairs in step.get("replace", {}).items():
        text = (folder / name).read_text()
        for old, new in pairs.items():
            assert old in text
            text = text.replace(old, new)
        (folder / name).write_text(text)


@pytest.mark.parametrize("name", SESSIONS)
def test_a_session_is_as_stored(
    pneucli: Command, bench: Path, strokes: Path, tanks: Path, monkeypatch: pytest.MonkeyPatch, name: str
) -> None:
    """Times and the folder's own path are left out."""
    monkeypatch.chdir(bench.parent)
    monkeypatch.setenv("COLUMNS", "120")
    lines = []
    for step in SESSIONS[name]:
        changed(step, bench.parent)
        for words in step.get("run", ()):
            told = pneucli(*shlex.split(words))
            lines += [f"$ pneucli {words}", told.out.rstrip(), *(f"! {line}" for line in told.err.splitlines())]
            lines += [f"exit {told.code}"] * bool(told.code)
        lines += [
            text for shown in step.get("show", ()) for text in (f"== {shown}", (bench.parent / shown).read_text())
        ]
        lines += [str(sorted(path.name for path in bench.parent.rglob("*")))] * ("list" in step)
    text = "\n".join(lines).replace(str(bench.parent), "DIR").replace(bench.parent.name, "DIR") + "\n"
    for pattern, instead in PASSES:
        text = re.sub(pattern, instead, text)
    hold_against(STORED / f"{name}.txt", text, rel=1e-9)
