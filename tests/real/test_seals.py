"""Seals on a bench that imposes the motion (TU Delft 2021)."""

import pytest

from tests.real.conftest import Answers

# N at 1, 3, 5, 7 bar: half the difference of retract and extend medians, as the recordings' description gives them
DESCRIBED = {
    "o-ring": (3.98, 5.50, 7.16, 7.98),
    "pk": (2.64, 3.58, 5.19, 6.60),
    "kdn": (5.65, 5.75, 6.12, 6.94),
    "x-ring257": (4.56, 6.50, 8.63, 15.53),
}


@pytest.mark.parametrize("seal", DESCRIBED)
def test_kinetic_friction_by_seal_and_pressure(answers: Answers, seal: str) -> None:
    kinetic = answers(f"zillen-{seal}")["identify"]["friction"]["kinetic"]
    assert [k["friction"] for k in kinetic] == pytest.approx(DESCRIBED[seal], rel=0.02)
    gauge = [(k["pressures"]["p1"] - 101_300) / 1e5 for k in kinetic]
    assert gauge == pytest.approx([1, 3, 5, 7], abs=0.1)


def test_one_level_of_friction_for_all_pressures_is_found_wanting(answers: Answers) -> None:
    """Friction grows with pressure and differs by direction: the base model's error is far above the sensors' noise."""
    answer = answers("zillen-o-ring")
    assert answer["compare"]["error"]["test"] > 3.0
    assert any("differs between recordings" in w for w in answer["identify"]["warnings"])
    kinetic = [k["friction"] for k in answer["identify"]["friction"]["kinetic"]]
    assert min(kinetic) < answer["identify"]["model"]["parameters"]["friction.coulomb"]["value"] < max(kinetic)


def test_friction_over_pressure_is_a_line_that_people_can_look_up(answers: Answers) -> None:
    """Described: 3.98 to 7.98 N from 1 to 7 bar, 0.667 N/bar between the ends; a seal breaks away above it."""
    friction = answers("zillen-o-ring")["identify"]["friction"]
    low, high = (1e5 * end for end in friction["over_pressure"]["slope"]["ci95"])
    assert low < (7.98 - 3.98) / 6 < high
    kinetic = {k["recording"]: k["friction"] for k in friction["kinetic"]}
    assert all(b["most"] > kinetic[b["recording"]] for b in friction["breakaway"])
    assert [b["count"] for b in friction["breakaway"]] == [20, 20, 20, 20]  # ten strokes there and back
