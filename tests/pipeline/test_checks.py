"""Checks are dotted paths into answers, with limits."""

from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from pneucli.errors import InputError
from pneucli.pipeline.checks import evaluate, resolve_path

ANSWERS: dict[str, Any] = {
    "compare": {
        "error": {"train": None, "test": 2.2},
        "model": {"parameters": {"friction.coulomb": {"value": 18.2, "ci95": [17.9, 18.5]}}},
        "channels": [
            {"recording": "axis_4", "channel": "p1", "percent": 0.21},
            {"recording": "axis_4", "channel": "x", "percent": 0.5},
            {"recording": "step_+2.0V", "channel": "p1", "percent": 0.9},
        ],
    },
    "diagnose": {"verdict": "adequate", "missing": []},
}


@pytest.mark.parametrize(
    ("path", "value"),
    [
        ("compare.error.test", 2.2),
        ("compare.model.parameters.friction.coulomb.value", 18.2),
        ("compare.model.parameters.friction.coulomb.ci95.1", 18.5),
        ("compare.channels.1.percent", 0.5),
        ("compare.channels.axis_4.x.percent", 0.5),
        ("compare.channels.step_+2.0V.percent", 0.9),
        ("diagnose.missing", []),
    ],
)
def test_a_path_leads_by_key_position_or_name(path: str, value: object) -> None:
    assert resolve_path(ANSWERS, path) == value


@pytest.mark.parametrize(
    ("path", "hint"),
    [
        ("compare.eror.test", 'did you mean "error"'),
        ("comparé.error", 'did you mean "compare"'),
        ("compare.channels.axis_5.p1", 'did you mean "axis_4"'),
        ("compare.error.test.more", "no .more. in the answer"),
    ],
)
def test_a_path_that_leads_nowhere_is_the_users_error(path: str, hint: str) -> None:
    with pytest.raises(InputError, match=hint):
        evaluate({path: {"max": 1}}, ANSWERS)


@given(value=st.floats(allow_nan=False), limit=st.floats(allow_nan=False))
def test_limits_are_inclusive(value: float, limit: float) -> None:
    def passed(kind: str) -> bool:
        return evaluate({"s.v": {kind: limit}}, {"s": {"v": value}})[0].passed

    assert passed("max") == (value <= limit)
    assert passed("min") == (value >= limit)
    assert passed("equals") == (value == limit)


@pytest.mark.parametrize("value", [None, "2", True, float("nan"), []])
def test_a_value_that_is_no_number_fails_a_limit(value: object) -> None:
    assert not evaluate({"s.v": {"max": 3.0}}, {"s": {"v": value}})[0].passed


def test_every_limit_of_a_check_must_hold_and_its_text_has_value_and_limit() -> None:
    low, inside = (evaluate({"s.v": {"min": 1, "max": 2}}, {"s": {"v": value}})[0] for value in (0.5, 1.5))
    assert (low.passed, inside.passed) == (False, True)
    assert str(low) == "s.v = 0.5 (min 1, max 2): FAILED"
