"""One run at a time uses an artifacts folder."""

from __future__ import annotations

import os
import threading
from pathlib import Path

import pytest

from pneucli.errors import InputError
from pneucli.pipeline.folders import LOCK_FILE, folder_lock


def test_a_second_run_waits_and_says_for_which_process(tmp_path: Path) -> None:
    events: list[str] = []
    waits = threading.Event()

    def notify(message: str) -> None:
        events.append(message)
        waits.set()

    def second() -> None:
        with folder_lock(tmp_path, notify):
            events.append("second")

    other = threading.Thread(target=second)
    with folder_lock(tmp_path, events.append):
        other.start()
        assert waits.wait(10)
        events.append("first ends")
    other.join(10)
    assert events == [f"waiting for another run (process {os.getpid()}) in {tmp_path}", "first ends", "second"]


def test_the_lock_is_free_again_after_a_failure(tmp_path: Path) -> None:
    with pytest.raises(ZeroDivisionError), folder_lock(tmp_path / "new", print):
        raise ZeroDivisionError
    said: list[str] = []
    with folder_lock(tmp_path / "new", said.append):
        assert said == []


def test_a_place_that_takes_no_folder_is_refused(tmp_path: Path) -> None:
    (tmp_path / "taken").write_text("a file")
    with (
        pytest.raises(InputError, match="cannot write artifacts there") as error,
        folder_lock(tmp_path / "taken", print),
    ):
        pass
    assert "--out" in error.value.mend


def test_a_lock_of_an_earlier_run_is_taken_over(tmp_path: Path) -> None:
    (tmp_path / LOCK_FILE).write_text("12345")
    with folder_lock(tmp_path, print):
        assert (tmp_path / LOCK_FILE).read_text() == str(os.getpid())
