"""The checks of a pipeline file: dotted paths into the stages' JSON answers, and what they must be."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from pneucli.errors import InputError, did_you_mean

ITEM_KEYS = ("name", "recording", "channel", "effect", "stage")  # by any of these an item of a list may be called


@dataclass(frozen=True)
class CheckResult:
    """One check: its dotted path, the limit (``{"max": 1.5}``), the value found, and whether it passed."""

    path: str
    limit: Mapping[str, Any]
    value: Any
    passed: bool

    def __str__(self) -> str:
        wanted = ", ".join(f"{kind} {limit}" for kind, limit in self.limit.items())
        value = f"{self.value:.4g}" if isinstance(self.value, float) else self.value
        return f"{self.path} = {value} ({wanted}): {'passed' if self.passed else 'FAILED'}"


def evaluate(
    checks: Mapping[str, Mapping[str, Any]], answers: Mapping[str, Mapping[str, Any]], where: str = "[checks]"
) -> list[CheckResult]:
    """Hold ``answers`` (stage -> JSON answer) against the table ``[checks]``, in the order of the file.

    ``checks`` maps a path to its limits, as in ``{"compare.error.test": {"max": 1.5}}``. The first word is the stage;
    an item of a list is called by its position or by its name, recording, channel or effect. A value that is null or
    not a number fails ``max`` and ``min``. Raises InputError where a path leads nowhere.
    """
    results = []
    for path, limit in checks.items():
        value = resolve_path(answers, path, where)
        results.append(CheckResult(path, limit, value, all(_satisfies(value, *item) for item in limit.items())))
    return results


def require_valid_path(path: str, answer_paths: Mapping[str, Sequence[str]], where: str = "[checks]") -> None:
    """Raise InputError where ``path`` can lead nowhere, whatever the answers will be.

    ``answer_paths`` holds for each stage where paths into its answer may begin (:class:`pneucli.pipeline.graph.Stage`).
    """
    stage, *words = path.split(".")
    begins = [tuple(begin.split(".")) for begin in answer_paths.get(stage, ())]
    if not begins:
        wanted = "a stage, then a key of its answer"
        raise InputError(
            f"{where}, key {path}", f'"{stage}" has no answer to check', wanted, did_you_mean(stage, answer_paths)
        )
    for depth, word in enumerate(words):
        here = {begin[depth] for begin in begins if begin[:depth] == tuple(words[:depth]) and len(begin) > depth}
        if here and word not in here:
            raise InputError(f"{where}, key {path}", f'no "{word}" in the answer', mend=did_you_mean(word, here))


def resolve_path(answers: Mapping[str, Any], path: str, where: str = "[checks]") -> Any:
    """Return what the dotted ``path`` leads to; a key that itself has dots is taken whole where it is there."""
    value: Any = answers
    words = path.split(".")
    while words:
        for count in range(len(words), 0, -1):
            found, inside = _step(value, ".".join(words[:count]))
            if found:
                value, words = inside, words[count:]
                break
        else:
            raise InputError(
                f"{where}, key {path}", f'no "{words[0]}" in the answer', mend=did_you_mean(words[0], _known(value))
            )
    return value


def _step(value: Any, word: str) -> tuple[bool, Any]:
    if isinstance(value, Mapping):
        return word in value, value.get(word)
    if isinstance(value, Sequence) and not isinstance(value, str):
        if word.isdigit() and int(word) < len(value):
            return True, value[int(word)]
        named = [item for item in value if isinstance(item, Mapping) and word in _names(item)]
        if len(named) > 1:
            return True, named  # several channels of one recording: the next word chooses among them
        return bool(named), named[0] if named else None
    return False, None


def _names(item: Mapping[str, Any]) -> list[str]:
    return [str(item[key]) for key in ITEM_KEYS if item.get(key) is not None]


def _known(value: Any) -> list[str]:
    if isinstance(value, Mapping):
        return list(value)
    if isinstance(value, Sequence) and not isinstance(value, str):
        items = [item for item in value if isinstance(item, Mapping)]
        return [name for item in items for name in _names(item)] or [f"0 to {len(value) - 1}"]
    return []


def _satisfies(value: Any, kind: str, limit: Any) -> bool:
    if kind == "equals":
        return bool(value == limit)
    if isinstance(value, bool) or not isinstance(value, int | float):
        return False
    return bool(value <= limit if kind == "max" else value >= limit)
