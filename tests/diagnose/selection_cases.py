"""The cases of the selection: read from ``selection_cases.toml``, whose head tells what a case states."""

import tomllib
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

from tests.diagnose.synthetic_data import Facts, SyntheticData, effect, synthetic_data

PATH = Path(__file__).with_suffix(".toml")
KEYS = {"name", "why", "given", "excess", "effects", "together", "errors", "expected"}
EFFECT_KEYS = {
    *(
        "explains",
        "predicted",
        "size",
        "at_bound",
        "at_bound_with",
        "interval",
        "raises_error",
        "raises_error_without",
        "needs",
        "parameters",
        "part",
        "twins",
    )
}


def selection_cases() -> list[dict[str, Any]]:
    """Return the cases in their order; a key that no case may have is an error."""
    cases: list[dict[str, Any]] = tomllib.loads(PATH.read_text(encoding="utf-8"))["case"]
    for case in cases:
        assert case.keys() <= KEYS, case["name"]
        for name, stated in case["effects"].items():
            assert stated.keys() <= EFFECT_KEYS, (case["name"], name)
    return cases


def data_of(case: dict[str, Any], **more: Any) -> SyntheticData:
    """Return the data of a diagnosis that a case states."""
    stated: dict[str, dict[str, Any]] = case["effects"]

    def of(key: str) -> dict[str, Any]:
        return {name: facts[key] for name, facts in stated.items() if key in facts}

    explained = {frozenset([name]): share for name, share in of("explains").items()}
    explained |= {frozenset(names.split()): share for names, share in case.get("together", {}).items()}
    facts = Facts(
        excess=case["excess"],
        explained=explained,
        predicted=of("predicted"),
        size=of("size"),
        at_bound=frozenset(of("at_bound")),
        at_bound_with=of("at_bound_with"),
        interval=of("interval"),
        raises_error=frozenset(of("raises_error")),
        raises_error_without=of("raises_error_without"),
        errors={frozenset(names.split()): error for names, error in case.get("errors", {}).items()},
        needs=of("needs"),
    )
    effects = [
        replace(
            effect(name, parameters=f.get("parameters", 1), part=f.get("part", "cylinder")),
            twins=tuple(f.get("twins", ())),
        )
        for name, f in stated.items()
    ]
    return synthetic_data(effects, facts, **{"base_effects": tuple(case.get("given", ())), **more})


def named(case: str) -> dict[str, Any]:
    """Return the case with a name."""
    return next(one for one in selection_cases() if one["name"] == case)


def names_of(effects: Sequence[Any]) -> list[str]:
    """Return the names of decisions, candidates or judgements."""
    return [(one.decision if hasattr(one, "decision") else one).effect.name for one in effects]
