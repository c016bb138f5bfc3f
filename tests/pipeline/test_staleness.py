"""A run does what is out of date, nothing else, and says why."""

import os
from pathlib import Path
from typing import Any

import numpy as np  # noqa: F401 - loads BLAS
import pytest
from threadpoolctl import threadpool_info, threadpool_limits

from pneucli.errors import InputError
from pneucli.pipeline import manifest as staleness
from pneucli.pipeline.graph import STAGES, NotApplicable, upstream
from pneucli.pipeline.manifest import Stamp, stamp
from pneucli.pipeline.runner import open_pipeline
from tests.pipeline.toys import STAGES as TOY_STAGES
from tests.pipeline.toys import TEXT, load, new, runs, toy

ALL = ["raw", "model", "judge", "page"]  # plan does not apply: it writes nothing into the log


@pytest.fixture
def file(tmp_path: Path) -> Path:
    return new(tmp_path)


def bring_up(file: Path, *targets: str, program: str = "1") -> list[str]:
    """Bring the targets (default: the page) up to date; return what was said."""
    said: list[str] = []
    toy(file, program).update(targets or ["page"], notify=said.append)
    return said


def test_first_run_does_all_in_order_and_the_second_nothing(file: Path) -> None:
    said = bring_up(file)
    assert runs(file) == ALL
    assert said[0] == "running raw (first time)"
    assert bring_up(file) == []
    assert runs(file) == []


def test_a_run_with_nothing_to_do_does_not_validate_the_file_again_but_a_changed_file_is(file: Path) -> None:
    bring_up(file)
    bring_up(file)
    assert (file.parent / "loaded.log").read_text().count("loaded") == 1
    file.write_text(TEXT + "\n# a comment makes nothing stale\n")
    bring_up(file)
    assert (file.parent / "loaded.log").read_text().count("loaded") == 2
    assert runs(file) == ALL


def test_a_stage_runs_only_the_stages_that_it_needs(file: Path) -> None:
    bring_up(file, "model")
    assert runs(file) == ["raw", "model"]
    bring_up(file, "judge")
    assert runs(file) == ["judge"]


def test_a_touched_file_makes_nothing_stale_and_is_hashed_once(file: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    bring_up(file)
    runs(file)
    touched = file.parent / "raw" / "a.csv"
    os.utime(touched, ns=(1, 1))
    assert bring_up(file) == []
    assert runs(file) == []
    manifest = staleness.read_manifest(file.parent / "artifacts" / "toy" / "raw")
    assert manifest is not None
    assert manifest.inputs.files["raw/a.csv"].mtime_ns == 1  # so that the next run need not read it


def test_a_file_of_known_size_and_time_is_not_read(tmp_path: Path) -> None:
    path = tmp_path / "large"
    path.write_bytes(b"x" * 10)
    status = path.stat()
    known = Stamp(status.st_size, status.st_mtime_ns, "as it was")
    assert stamp(path, known) is known
    assert stamp(path, Stamp(status.st_size, 0, "as it was")).sha256 != "as it was"


def test_a_changed_raw_file_is_named_and_all_later_stages_run(file: Path) -> None:
    bring_up(file)
    runs(file)
    (file.parent / "raw" / "b.csv").write_text("1")
    assert bring_up(file)[:2] == ["running raw (changed raw/b.csv)", "running model (raw is stale)"]
    assert runs(file) == ALL


def test_a_new_file_in_the_glob_and_one_that_is_gone_are_noticed(file: Path) -> None:
    bring_up(file)
    (file.parent / "raw" / "c.csv").write_text("2")
    assert bring_up(file)[0] == "running raw (new raw/c.csv)"
    (file.parent / "raw" / "c.csv").unlink()
    assert bring_up(file)[0] == "running raw (no longer raw/c.csv)"


def test_environment_variables_in_file_names_are_followed(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    file = new(tmp_path, TEXT.replace("raw/", "${TOY_RAW}/"))
    monkeypatch.setenv("TOY_RAW", str(tmp_path / "raw"))
    bring_up(file)
    (tmp_path / "raw" / "a.csv").write_text("7")
    assert bring_up(file)[0] == "running raw (changed raw/a.csv)"


@pytest.mark.parametrize(
    ("text", "again"),
    [
        (TEXT.replace("effects = []", 'effects = ["x"]'), ["model", "judge", "page"]),
        (TEXT + "[judge]\nhorizon = 1\n", ["judge", "page"]),
        (TEXT + "[checks]\n'judge.generation' = {equals = '00'}\n", ["page"]),
        (TEXT + "[plan]\n", ["plan", "page"]),
        (TEXT.replace("[model]", "# words\n[model]  # and more words"), []),
    ],
)
def test_a_changed_table_makes_its_readers_and_their_children_stale(file: Path, text: str, again: list[str]) -> None:
    bring_up(file)
    runs(file)
    file.write_text(text)
    bring_up(file)
    assert sorted(runs(file)) == sorted(again)


def test_a_changed_program_makes_all_stale(file: Path) -> None:
    bring_up(file)
    assert bring_up(file, program="2")[0] == "running raw (the program changed)"


@pytest.mark.parametrize("harm", [Path.unlink, lambda path: path.write_text("scribble")])
def test_a_damaged_artifact_and_only_it_is_made_again(file: Path, harm: object) -> None:
    bring_up(file)
    runs(file)
    harm(file.parent / "artifacts" / "toy" / "model" / "part-2.txt")  # type: ignore[operator]
    assert bring_up(file) == ["running model (its file part-2.txt is missing or was changed)"]
    assert runs(file) == ["model"]


def test_with_a_broken_manifest_all_files_count_as_foreign(file: Path) -> None:
    bring_up(file)
    judge = file.parent / "artifacts" / "toy" / "judge"
    (judge / "stage.json").write_text('{"schema": "pneucli/st')
    with pytest.raises(InputError, match="move it away"):
        bring_up(file)
    judge.rename(file.parent / "moved")
    assert bring_up(file) == ["running judge (first time)"]


def test_options_stay_until_the_stage_is_asked_with_others(file: Path) -> None:
    def ask(options: dict[str, dict[str, object]] | None) -> list[str]:
        toy(file).update(["judge"], options)
        return runs(file)

    ask({"judge": {"exclude": ["x"]}})
    assert ask(None) == []
    assert ask({"judge": {"exclude": []}}) == ["judge"]
    assert ask({"judge": {"exclude": [], "executor": "dask://here:8786"}}) == []  # where it is done changes no answer


def test_an_inapplicable_stage_is_skipped_once_and_an_error_by_name(file: Path) -> None:
    done = toy(file).update(["page", "plan"])
    with pytest.raises(NotApplicable, match="no \\[plan\\]"):
        _ = done["plan"].answer
    assert toy(file).update(["plan"])["plan"].reasons == ()


def test_an_answer_is_the_same_when_it_is_made_and_when_it_is_read(file: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("tests.pipeline.toys.model.run", lambda context: {"pair": (1, 0.1), 2: None})
    made, read = (toy(file).update(["model"])["model"].answer for _ in range(2))
    assert made == read == {"pair": [1, 0.1], "2": None}


@pytest.mark.parametrize("value", [float("nan"), float("inf"), {1, 2}])
def test_an_answer_that_json_cannot_represent_is_refused(
    file: Path, monkeypatch: pytest.MonkeyPatch, value: object
) -> None:
    monkeypatch.setattr("tests.pipeline.toys.model.run", lambda context: {"value": value})
    with pytest.raises((ValueError, TypeError), match="JSON"):
        toy(file).update(["model"])
    assert not (file.parent / "artifacts" / "toy" / "model").exists()


def test_a_stage_has_one_blas_thread_whatever_the_machine_has(file: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """On matrices of twenty columns threads wait for each other: on a busy machine that took ten times as long."""

    def blas(context: Any) -> dict[str, Any]:
        return {"threads": [i["num_threads"] for i in threadpool_info() if i["user_api"] == "blas"]}

    monkeypatch.setattr("tests.pipeline.toys.raw.run", blas)
    with threadpool_limits(2, user_api="blas"):
        threads = toy(file).update(["raw"])["raw"].answer["threads"]
        assert [i["num_threads"] for i in threadpool_info() if i["user_api"] == "blas"] == [2] * len(threads)
    assert threads
    assert set(threads) == {1}


def test_a_failed_stage_keeps_the_former_folder(file: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    bring_up(file)
    runs(file)
    before = (file.parent / "artifacts" / "toy" / "model" / "part-0.txt").read_text()
    file.write_text(TEXT.replace("effects = []", "effects = [1]"))
    with monkeypatch.context() as patch:
        patch.setattr("tests.pipeline.toys.model.run", lambda context: 1 / 0)
        with pytest.raises(ZeroDivisionError):
            bring_up(file)
    assert (file.parent / "artifacts" / "toy" / "model" / "part-0.txt").read_text() == before
    assert bring_up(file)[0] == "running model (changed [model])"


def harm_nothing(file: Path, place: str, *targets: str) -> None:
    """Hold a refusal against the rules: the file in ``place`` stays, and nothing is made beside it."""
    mine = file.parent / "artifacts" / "toy" / place
    mine.parent.mkdir(parents=True, exist_ok=True)
    mine.write_text("my notes")
    there = sorted(mine.parents[len(Path(place).parts) - 1].rglob("*"))
    with pytest.raises(InputError, match="pneucli did not write") as error:
        bring_up(file, *targets)
    assert Path(place).parts[0] in str(error.value)
    assert "mend: move it away" in str(error.value)
    assert mine.read_text() == "my notes"
    assert sorted(mine.parents[len(Path(place).parts) - 1].rglob("*")) == there


@pytest.mark.parametrize("place", ["model/mine.txt", "model", ".model.new/mine.txt", ".model.old/mine.txt", ".lock"])
def test_a_foreign_file_in_place_of_a_folder_is_refused_and_stays(file: Path, place: str) -> None:
    harm_nothing(file, place)


@pytest.mark.parametrize("place", ["model/mine.txt", "model/folder/mine.txt", "model/.mine", ".model.new/mine.txt"])
def test_a_foreign_file_in_a_stages_folder_is_refused_and_stays(file: Path, place: str) -> None:
    bring_up(file)
    harm_nothing(file, place)
    (file.parent / "raw" / "a.csv").write_text("1")
    harm_nothing(file, place)
    assert bring_up(file, "raw") == ["running raw (changed raw/a.csv)"]  # for what does not touch it, it is no matter


def test_a_foreign_file_that_appears_during_a_run_stays_and_the_run_fails(
    file: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    bring_up(file)
    mine = file.parent / "artifacts" / "toy" / "model" / "mine.txt"
    monkeypatch.setattr("tests.pipeline.toys.model.run", lambda context: {"saved": mine.write_text("my notes")})
    (file.parent / "raw" / "a.csv").write_text("1")
    with pytest.raises(InputError, match=r"mine\.txt, which pneucli did not write"):
        bring_up(file)
    assert mine.read_text() == "my notes"
    assert not (mine.parents[1] / ".model.new").exists()


def test_a_link_in_the_place_of_a_folder_and_a_marker_of_another_program_stay(file: Path) -> None:
    (file.parent / "elsewhere").mkdir()
    artifacts = file.parent / "artifacts" / "toy"
    artifacts.mkdir(parents=True)
    (artifacts / "model").symlink_to(file.parent / "elsewhere")
    with pytest.raises(InputError, match="pneucli did not write"):
        bring_up(file)
    (artifacts / "model").unlink()
    (artifacts / ".validated").write_text("my notes")
    bring_up(file)
    assert (artifacts / ".validated").read_text() == "my notes"


def second(file: Path, text: str = TEXT) -> Path:
    """Another pipeline file beside ``file``, by default of the same name."""
    other = file.with_name("second.toml")
    other.write_text(text)
    return other


def test_two_pipelines_of_one_name_in_one_folder_are_refused(file: Path) -> None:
    bring_up(file)
    with pytest.raises(InputError) as refused:
        toy(second(file))
    assert refused.value.found.startswith(f'"toy" is also the name of {file}, ')
    assert refused.value.mend == "rename one of them, or name another folder with --out"
    assert bring_up(file) == []


def test_the_second_of_two_that_were_opened_at_once_is_refused_too(file: Path) -> None:
    other = toy(second(file))
    bring_up(file)
    with pytest.raises(InputError, match="is also the name of"):
        other.update(["page"])


def test_a_pipeline_file_that_was_renamed_keeps_its_artifacts(file: Path) -> None:
    bring_up(file)
    renamed = file.rename(file.with_name("renamed.toml"))
    assert bring_up(renamed) == []
    with pytest.raises(InputError, match=r"renamed\.toml, whose artifacts"):
        toy(second(renamed))


def test_a_folder_that_was_moved_as_a_whole_keeps_its_artifacts(file: Path, tmp_path: Path) -> None:
    folder = tmp_path / "original"
    original = new(folder)
    bring_up(original)
    folder.rename(tmp_path / "moved")
    new(folder)
    moved = tmp_path / "moved" / "toy.toml"
    assert bring_up(moved) == []


@pytest.mark.parametrize("text", [TEXT.replace("toy", "other"), "no = pipeline"])
def test_a_name_that_the_other_file_has_no_more_is_free(file: Path, text: str) -> None:
    bring_up(file)
    other = second(file)
    file.write_text(text)
    assert bring_up(other) == []


def test_another_folder_may_be_named_for_the_second_pipeline(file: Path) -> None:
    bring_up(file)
    pipeline = open_pipeline(second(file), load, file.parent / "artifacts" / "elsewhere", stages=TOY_STAGES)
    assert pipeline.name == "toy"


def test_a_stage_that_fails_leaves_nothing_half_written(file: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("tests.pipeline.toys.raw.run", lambda context: (context.out / "part").write_text("") or 1 / 0)
    with pytest.raises(ZeroDivisionError):
        bring_up(file)
    assert sorted(p.name for p in (file.parent / "artifacts" / "toy").iterdir()) == [".lock", ".validated"]


@pytest.mark.parametrize("name", ["~/a.csv", "${HOME}/a.csv", "${HOME}/*.csv"])
def test_a_changed_file_is_noticed_however_its_path_is_written(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, name: str
) -> None:
    file = new(tmp_path / "toy", TEXT.replace("raw/*.csv", name))
    monkeypatch.setenv("HOME", str(tmp_path))
    (tmp_path / "a.csv").write_text("1")
    bring_up(file)
    (tmp_path / "a.csv").write_text("2")
    assert bring_up(file)[0] == "running raw (changed ../a.csv)"


def test_a_plugin_is_found_like_a_raw_file(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("HOME", str(tmp_path))
    (tmp_path / "own.py").write_text("")
    found = staleness.named_files({"model": {"plugins": ["~/*.py"]}}, "model", "plugins", tmp_path / "rig" / "a.toml")
    assert found == {"../own.py": tmp_path / "own.py"}


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="pipes in the file system")
def test_neither_a_folder_nor_a_pipe_nor_a_device_is_read(tmp_path: Path) -> None:
    os.mkfifo(tmp_path / "pipe")
    for path in (tmp_path, tmp_path / "pipe", Path("/dev/zero"), tmp_path / ("x" * 300)):
        assert stamp(path) == Stamp(-1, 0, "")


def test_survey_writes_nothing(file: Path) -> None:
    verdicts = toy(file).stage_status(["page"])
    assert all(verdict.reasons == ("never done",) for verdict in verdicts.values())
    assert not (file.parent / "artifacts").exists()


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("[pipeline\n", "line 1"),
        ("[pipeline]\nname = '../up'\n", "cannot be the name of a folder"),
        ("[rig]\n", "no name"),
        ("pipeline = 3\n", "no name"),
    ],
)
def test_an_unreadable_file_is_an_input_error(tmp_path: Path, text: str, message: str) -> None:
    file = tmp_path / "bad.toml"
    file.write_text(text)
    with pytest.raises(InputError, match=message):
        toy(file)


def test_a_missing_file_and_a_folder_that_cannot_be_written_are_the_users_errors(file: Path) -> None:
    with pytest.raises(InputError, match="cannot be read"):
        toy(file.parent / "none.toml")
    (file.parent / "artifacts").write_text("a file where the folder should be")
    with pytest.raises(InputError, match="--out"):
        bring_up(file)


def test_the_real_graph_runs_parents_first_and_reads_only_stages_it_knows() -> None:
    order = upstream(STAGES)
    for name, stage in STAGES.items():
        assert {*stage.parents, *stage.optional} <= set(STAGES)
        assert all(order.index(parent) < order.index(name) for parent in stage.parents)
    assert upstream(["compare"]) == ["ingest", "identify", "compare"]


def test_a_pipe_has_no_stamp_and_is_not_waited_for(tmp_path: Path) -> None:
    os.mkfifo(tmp_path / "pipe")
    assert stamp(tmp_path / "pipe") == Stamp(-1, 0, "")
    assert stamp(tmp_path).size == -1
