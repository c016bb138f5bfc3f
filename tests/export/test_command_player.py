"""The exported player gives the planned commands, starts softly, and shuts the valve where a limit is exceeded."""

import ctypes
import re
import shutil
import subprocess
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from pneucli.export.command_player import PlayedRecording, PlayerLimits, write_players
from pneucli.plan.bench import hold, ramp, sample, sine

LIMITS = PlayerLimits(
    null=5.0, command=4.0, position=(0.01, 0.19), pressure=8e5, soft_start=0.1, max_speed=0.2, mirrored=True
)
VALVE = PlayedRecording("valve", False, 0.0, (hold(5.0, 0.1), sine(5.0, 2.0, 10.0, 0.5), hold(5.0, 0.1)), 0.05)
MOTION = PlayedRecording("motion", True, 100.0, (hold(0.1, 0.1), ramp(0.1, 0.12, 0.2)), 0.05)
SAFE = (0.1, 3e5, 3e5)

pytestmark = pytest.mark.skipif(shutil.which("gcc") is None, reason="no gcc")


class Player(ctypes.Structure):
    _fields_ = (
        ("soft", ctypes.c_double),
        ("time", ctypes.c_double),
        ("first_x", ctypes.c_double),
        ("segment", ctypes.c_int),
        ("state", ctypes.c_int),
    )


@pytest.fixture(scope="module")
def step(tmp_path_factory: pytest.TempPathFactory) -> Callable[[], Callable[..., list[float]]]:
    """Return a function that starts a compiled player and returns its sample."""
    folder: Path = tmp_path_factory.mktemp("player")
    write_players(folder, {"c", "st"}, [VALVE, MOTION], LIMITS, "rig */ 1")
    command = ["gcc", "-std=c99", "-Wall", "-Wextra", "-Werror", "-pedantic", "-shared", "-fPIC"]
    subprocess.run([*command, folder / "pneucli_player.c", "-o", folder / "player.so", "-lm"], check=True)
    library = ctypes.CDLL(str(folder / "player.so"))
    library.pneucli_player_step.argtypes = [ctypes.c_void_p, ctypes.c_int, *3 * [ctypes.c_double], ctypes.c_void_p]

    def start() -> Callable[..., list[float]]:
        player, out = Player(), (ctypes.c_double * 4)()
        library.pneucli_player_init(ctypes.byref(player))

        def sample_of(enable: bool, x: float, p1: float, p2: float) -> list[float]:
            library.pneucli_player_step(ctypes.byref(player), int(enable), x, p1, p2, out)
            return list(out)

        return sample_of

    return start


def run(play, count: int, x: float = 0.1) -> np.ndarray:
    return np.array([play(True, x, 3e5, 3e5) for _ in range(count)])


def test_it_waits_at_the_null_command_until_it_is_enabled(step) -> None:
    play = step()
    assert all(play(False, *SAFE)[:2] == [5.0, 5.0] for _ in range(50))


def test_the_commands_of_a_recording_are_those_of_the_plan(step) -> None:
    rows = run(step(), 900)
    played = rows[rows[:, 3] == 1.0, 0]
    assert played == pytest.approx(sample(VALVE.segments, 1e-3), abs=1e-9)
    assert rows[:, 0] + rows[:, 1] == pytest.approx(10.0)  # the second valve mirrors about the null command


def test_a_position_is_followed_by_the_loop_after_a_soft_start(step) -> None:
    rows = run(step(), 1300, x=0.1)
    moving = rows[rows[:, 3] == 2.0]
    assert moving[:, 2] == pytest.approx(sample(MOTION.segments, 1e-3), abs=1e-9)
    assert moving[:, 0] == pytest.approx(np.clip(5.0 + 100.0 * (moving[:, 2] - 0.1), 1.0, 9.0))
    assert rows[-1, :2].tolist() == [5.0, 5.0]  # done: shut


def test_a_loop_after_commands_at_the_valve_takes_the_piston_softly_from_where_it_is(step) -> None:
    play = step()
    rows = np.array([play(True, 0.15, 3e5, 3e5) for _ in range(1500)])
    assert (rows[:, 3] == 2.0).any()
    begin = int(np.flatnonzero(rows[:, 3] == 2.0)[0])
    assert rows[: begin - 250, 2] == pytest.approx(0.15)  # the reference is the reading until the loop begins
    way = rows[begin - 250 : begin, 2]
    assert way[0] == pytest.approx(0.15, abs=1e-3)
    assert way[-1] == pytest.approx(0.1, abs=1e-3)
    assert np.abs(np.diff(rows[: begin + 1, 2])).max() <= 0.2e-3 + 1e-12  # 0.05 m take 0.25 s, not 0.1


@pytest.mark.parametrize("reading", [(0.195, 3e5, 3e5), (0.1, 9e5, 3e5), (0.1, 3e5, 9e5), (float("nan"), 3e5, 3e5)])
def test_a_reading_beyond_its_limit_shuts_the_valve_for_good(step, reading: tuple[float, float, float]) -> None:
    play = step()
    run(play, 300)
    assert play(True, *reading)[:2] == [5.0, 5.0]
    assert all(play(True, *SAFE)[:2] == [5.0, 5.0] for _ in range(400))


def test_a_player_that_is_disabled_does_not_go_on_by_itself(step) -> None:
    play = step()
    run(play, 300)
    play(False, *SAFE)
    assert all(play(True, *SAFE)[0] == 5.0 for _ in range(400))


def test_the_structured_text_is_grammatical_and_its_numbers_have_a_point(tmp_path: Path) -> None:
    blark = pytest.importorskip("blark.parse", reason="needs blark")
    small = PlayedRecording("small", True, 100.0, (sine(0.1, 2e-5, 10.0, 0.5),), 0.05)
    unlimited = replace(LIMITS, position=None, pressure=None, max_speed=None)
    write_players(tmp_path, {"st"}, [VALVE, small], unlimited, "rig")
    text = (tmp_path / "pneucli_player.st").read_text(encoding="utf-8")
    assert blark.parse_source_code(text).exception is None
    assert "2.0E-5" in text
    assert "1.0E30" in text
    assert not re.search(r"\de[-+]?\d", text)
