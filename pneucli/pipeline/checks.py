"""Evaluate the checks of a pipeline file: dotted paths into the stages' JSON answers, and their limits."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from pneucli.errors import InputError, did_you_mean, require_known
from pneucli.messages.formatting import format_plain

ITEM_KEYS = ("name", "recording", "channel", "effect", "stage")  # each of them selects an item of a list


@dataclass(frozen=True)
class CheckResult:
    """One check: its dotted path, the limit (``{"max": 1.5}``), the value, and whether it passed."""

    path: str
    limit: Mapping[str, Any]
    value: Any
    passed: bool

    def __str__(self) -> str:
        wanted = ", ".join(f"{kind} {limit}" for kind, limit in self.limit.items())
        value = format_plain(self.value, 4) if isinstance(self.value, float) else self.value
        return f"{self.path} = {value} ({wanted}): {'passed' if self.passed else 'FAILED'}"


def evaluate(
    checks: Mapping[str, Mapping[str, Any]], answers: Mapping[str, Mapping[str, Any]], where: str = "[checks]"
) -> list[CheckResult]:
    """Evaluate the table ``[checks]`` in the order of the file.

    A path begins with the stage; its position or its name, recording, channel or effect selects an item of a list. A
    value that is null or not a number fails ``max`` and ``min``.

    Args:
        checks: The limits by path, such as ``{"compare.error.test": {"max": 1.5}}``.
        answers: The JSON answers by stage.
        where: The place of the table, for errors.

    Raises:
        InputError: A path leads nowhere.

    """
    results = []
    for path, limit in checks.items():
        value = resolve_path(answers, path, where)
        results.append(CheckResult(path, limit, value, all(_satisfies(value, *item) for item in limit.items())))
    return results


def require_valid_path(path: str, answer_paths: Mapping[str, Sequence[str]], where: str = "[checks]") -> None:
    """Raise InputError where ``path`` leads nowhere in any answer.

    ``answer_paths`` has the possible beginnings of paths by stage (:class:`pneucli.pipeline.graph.Stage`).
    """
    stage, *parts = path.split(".")
    begins = [tuple(begin.split(".")) for begin in answer_paths.get(stage, ())]
    wanted = "a stage, then a key of its answer"
    require_known([stage], answer_paths, f"{where}, key {path}", '"{}" has no answer to check', wanted, code="E027")
    for depth, part in enumerate(parts):
        here = {begin[depth] for begin in begins if begin[:depth] == tuple(parts[:depth]) and len(begin) > depth}
        if here:
            require_known([part], here, f"{where}, key {path}", 'no "{}" in the answer', code="E027")


def resolve_path(answers: Mapping[str, Any], path: str, where: str = "[checks]") -> Any:
    """Return the value at the dotted ``path``; keys may contain dots themselves."""
    value: Any = answers
    parts = path.split(".")
    while parts:
        for count in range(len(parts), 0, -1):
            found, inside = _step(value, ".".join(parts[:count]))
            if found:
                value, parts = inside, parts[count:]
                break
        else:
            raise InputError(
                f"{where}, key {path}",
                f'no "{parts[0]}" in the answer',
                mend=did_you_mean(parts[0], _choices(value)),
                code="E027",
            )
    return value


def _step(value: Any, part: str) -> tuple[bool, Any]:
    if isinstance(value, Mapping):
        return part in value, value.get(part)
    if isinstance(value, Sequence) and not isinstance(value, str):
        if part.isdigit() and int(part) < len(value):
            return True, value[int(part)]
        named = [item for item in value if isinstance(item, Mapping) and part in _names(item)]
        if len(named) > 1:
            return True, named  # several channels of one recording: the next part of the path selects one
        return bool(named), named[0] if named else None
    return False, None


def _names(item: Mapping[str, Any]) -> list[str]:
    return [str(item[key]) for key in ITEM_KEYS if item.get(key) is not None]


def _choices(value: Any) -> list[str]:
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
