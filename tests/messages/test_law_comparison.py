"""What is said of the bench of controllers."""

from __future__ import annotations

from pneucli.messages import design
from tests.report.controlled import bench as figures

CASES = {"best": figures(4.0, 0.0), "pdc": figures(7800.0, 3.0), "relay": figures(30.0, 40.0)}


def test_a_row_holds_the_worst_of_all_scenarios_and_the_air_of_all() -> None:
    (best, *_) = design.law_rows(CASES, 10.0)
    assert best == ["best", "4.00", "0", "–", "∞", "0.30", "0.800", "–", "holds"]
    back = {name: by | {"load": by["load"] | {"recovery_s": 0.25}} for name, by in CASES.items()}
    assert next(iter(design.law_rows(back, 10.0)))[4] == "0.25"


def test_the_share_in_sliding_is_the_least_of_both_observers_and_all_scenarios() -> None:
    steps = CASES["best"]["steps"] | {"sliding_load": 0.97, "sliding_flow": 0.23}
    load = CASES["best"]["load"] | {"sliding_load": 0.99, "sliding_flow": None}
    (row,) = design.law_rows({"compensated": {"steps": steps, "load": load}}, 10.0)
    assert row[7] == "23 %"


def test_a_poor_control_law_is_named_with_its_figures() -> None:
    assert design.shortcomings(CASES, 10.0) == [
        "pdc stays up to 7.8 mm off",
        "relay stays up to 30 µm off, moves by 40 µm at rest",
    ]
