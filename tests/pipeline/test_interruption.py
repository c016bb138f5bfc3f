"""Killed anywhere, nothing is lost or half-written; two runs in one folder do not harm each other."""

import os
import random
import signal
import subprocess
import sys
import threading
import time
from pathlib import Path

import pytest

from pneucli.errors import InputError
from pneucli.pipeline import manifest as folders
from pneucli.pipeline.manifest import LOCK_FILE, folder_lock
from tests.pipeline.toys import generations, is_whole, new, runs, toy

ROOT = Path(__file__).parents[2]
RUN = "import sys; from pathlib import Path; from tests.pipeline import toys; toys.PACE = float(sys.argv[2]); "
RUN += "toys.toy(Path(sys.argv[1])).update(['page'], notify=lambda m: print(m, file=sys.stderr, flush=True))"


def start(file: Path, pace: float = 1.0) -> subprocess.Popen[str]:
    """Start a run in a process of its own; at pace 1 it takes about 0.1 s."""
    words = [sys.executable, "-c", RUN, str(file), str(pace)]
    return subprocess.Popen(words, cwd=ROOT, stderr=subprocess.PIPE, text=True)


def whole(file: Path) -> list[str]:
    """Names of the stages whose folders are there; each of them must be whole."""
    folders = [folder for folder in toy(file).artifacts.glob("[a-z]*") if folder.name != "plan"]
    assert all(is_whole(folder) for folder in folders)
    return sorted(folder.name for folder in folders)


@pytest.mark.skipif(sys.platform == "win32", reason="forks")
def test_killed_at_every_operation_on_files(tmp_path: Path) -> None:
    result = subprocess.run(
        [sys.executable, "-m", "tests.pipeline.killed", str(tmp_path / "toy")],
        cwd=ROOT, capture_output=True, text=True, check=False,
    )  # fmt: skip
    assert result.returncode == 0, result.stderr
    assert int(result.stdout) > 20  # 2 stages of 5 files, a manifest and a swap each: else the hook saw nothing


def test_killed_at_random_moments(tmp_path: Path) -> None:
    file, chance = new(tmp_path / "toy"), random.Random(2)
    toy(file).update(["page"])
    for generation in range(12):
        (file.parent / "raw" / "a.csv").write_text(str(generation))
        process = start(file)
        time.sleep(chance.uniform(0.05, 0.4))
        process.kill()
        process.communicate()
        assert process.returncode in (0, -signal.SIGKILL)  # it did not fail on its own
        whole(file)
    done = toy(file).update(["page"])
    done.pop("plan")
    assert generations(done) == {"110"}
    assert whole(file) == ["judge", "model", "page", "raw"]


def test_a_swap_that_was_cut_in_the_middle_is_undone(tmp_path: Path) -> None:
    (tmp_path / ".model.old").mkdir()
    (tmp_path / ".model.old" / "result").write_text("old")
    (tmp_path / ".model.new").mkdir()
    folders.recover_folder(tmp_path, "model")
    assert (tmp_path / "model" / "result").read_text() == "old"
    assert [path.name for path in tmp_path.iterdir()] == ["model"]


def test_finished_stages_do_not_run_again_after_a_kill(tmp_path: Path) -> None:
    file = new(tmp_path / "toy")
    process = start(file)
    assert process.stderr is not None
    for line in process.stderr:
        if line.startswith("model"):
            process.kill()
    process.wait()
    process.stderr.close()
    assert runs(file)[:1] == ["raw"]
    toy(file).update(["page"])
    assert "raw" not in runs(file)


def test_two_runs_in_one_folder_wait_for_each_other_and_share_the_work(tmp_path: Path) -> None:
    file = new(tmp_path / "toy")
    processes = [start(file, pace=8.0) for _ in range(3)]
    said = [process.communicate()[1] for process in processes]
    assert [process.returncode for process in processes] == [0, 0, 0]
    assert sorted(runs(file)) == ["judge", "model", "page", "raw"]
    assert sum("waiting for another run" in text for text in said) == 2
    assert whole(file) == ["judge", "model", "page", "raw"]


def test_a_dead_owners_lock_is_free(tmp_path: Path) -> None:
    file = new(tmp_path / "toy")
    process = start(file)
    assert process.stderr is not None
    process.stderr.readline()  # it holds the lock: it says what it does
    process.kill()
    process.communicate()
    said: list[str] = []
    toy(file).update(["page"], notify=said.append)
    assert not any("waiting" in message for message in said)


# --- one run at a time uses an artifacts folder


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
