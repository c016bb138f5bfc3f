"""The history of a model: every one that was compared is kept once, with its curves, in the stage's own folder."""

import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from pneucli.pipeline import manifest
from pneucli.pipeline.graph import Context
from pneucli.pipeline.manifest import Inputs, Manifest
from pneucli.stages import history

CURVES = "residuals.parquet"


def answer(*effects: str, coulomb: float = 14.0, data: str = "bench") -> dict[str, Any]:
    parameters = {"friction.coulomb": {"value": coulomb, "unit": "N", "ci95": [coulomb - 1, coulomb + 1]}}
    return {"model": {"effects": list(effects), "parameters": parameters}, "error": {"test": 2.0}, "data": data}


class Stage:
    """A stage that is run again and again, as the runner does it."""

    def __init__(self, folder: Path) -> None:
        self.folder, self.runs = folder / "compare", 0

    def run(self, one: dict[str, Any]) -> dict[str, Any]:
        self.runs += 1
        out = self.folder.with_name(f".compare.{self.runs}")
        out.mkdir()
        (out / CURVES).write_text(" ".join(one["model"]["effects"]))
        context: Any = replace(Context(out, None, out, out), former=self.folder)  # type: ignore[arg-type]
        whole = one | history.record_model(context, one, CURVES)
        Manifest("compare", Inputs("1", {}, {}, {}, {}), answer=whole).write(out)
        if self.folder.exists():
            self.folder.rename(self.folder.with_name(f"old-{self.runs}"))
        out.rename(self.folder)
        return whole


@pytest.fixture
def stage(tmp_path: Path) -> Stage:
    return Stage(tmp_path)


def effects(stage: Stage) -> list[list[str]]:
    return [one.answer["model"]["effects"] for one in history.recorded_models(stage.folder)]


def test_the_first_model_has_no_history(stage: Stage) -> None:
    stage.run(answer())
    assert [(one.answer["number"], one.current) for one in history.recorded_models(stage.folder)] == [(1, True)]
    assert not (stage.folder / "history").exists()


def test_models_are_kept_in_the_order_in_which_they_came(stage: Stage) -> None:
    for names in ((), ("stribeck",), ("stribeck", "piston-leak")):
        stage.run(answer(*names))
    assert effects(stage) == [[], ["stribeck"], ["stribeck", "piston-leak"]]
    assert [one.current for one in history.recorded_models(stage.folder)] == [False, False, True]


def test_curves_of_former_models_stay_and_take_no_room_of_their_own(stage: Stage) -> None:
    stage.run(answer("stribeck"))
    inode = (stage.folder / CURVES).stat().st_ino
    stage.run(answer("piston-leak"))
    former = history.recorded_models(stage.folder)[0]
    assert (former.folder / CURVES).read_text() == "stribeck"
    assert (former.folder / CURVES).stat().st_ino == inode


def test_a_model_that_comes_back_is_there_once_and_since_when_it_was_first(
    stage: Stage, monkeypatch: pytest.MonkeyPatch
) -> None:
    first = stage.run(answer())
    stage.run(answer("stribeck"))
    again = stage.run(answer())
    assert (again["number"], again["when"]) == (first["number"], first["when"])
    assert effects(stage) == [[], ["stribeck"]]
    assert [one.current for one in history.recorded_models(stage.folder)] == [True, False]


def test_other_parameters_or_other_data_are_another_model(stage: Stage) -> None:
    stage.run(answer())
    stage.run(answer(coulomb=14.1))
    stage.run(answer(data="another bench"))
    assert len(history.recorded_models(stage.folder)) == 3
    stage.run(answer(coulomb=14.1 * (1 + 1e-12)))  # rounding is not another model
    assert len(history.recorded_models(stage.folder)) == 3


def test_a_model_whose_curves_are_gone_is_not_kept(stage: Stage) -> None:
    stage.run(answer())
    (stage.folder / CURVES).unlink()
    stage.run(answer("stribeck"))
    assert effects(stage) == [["stribeck"]]


def test_a_folder_of_an_older_program_counts_as_empty(stage: Stage) -> None:
    stage.run(answer())
    content = json.loads((stage.folder / manifest.MANIFEST_FILE).read_text())
    del content["answer"]["number"]
    (stage.folder / manifest.MANIFEST_FILE).write_text(json.dumps(content))
    assert history.recorded_models(stage.folder) == []
    assert stage.run(answer("stribeck"))["number"] == 1


def test_without_links_files_are_copied(stage: Stage, monkeypatch: pytest.MonkeyPatch) -> None:
    def refuse(source: Path, target: Path) -> None:
        raise OSError("no links here")

    monkeypatch.setattr("os.link", refuse)
    stage.run(answer("stribeck"))
    stage.run(answer())
    assert (history.recorded_models(stage.folder)[0].folder / CURVES).read_text() == "stribeck"
