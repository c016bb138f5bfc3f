"""What is misspelt in the pipeline file is found when it is loaded, and not after minutes."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

from pneucli.errors import InputError
from pneucli.pipeline.runner import open_pipeline
from pneucli.stages.pipeline_file import load_pipeline_file
from tests.cli.toys import PIPELINE
from tests.stages.chain import known_as_declared
from tests.stages.conftest import DEMO

Demo = tuple[Path, dict[str, Any]]


def edited(tmp_path: Path, more: str) -> Path:
    path = tmp_path / "pipeline.toml"
    path.write_text(DEMO.read_text(encoding="utf-8").partition("[checks]")[0] + more, encoding="utf-8")
    return path


@pytest.mark.parametrize(
    ("more", "says"),
    [
        ("[design]\nperoid = 0.001", 'key design.peroid: unknown key [E021]\n  mend: did you mean "period"?'),
        ('[design]\nperiod = "1 mm"', "key design.period"),
        ('[design]\nperiod = "1 ns"', "from 1·10⁻⁵ s to 1 s"),
        ("[design]\nchamber_2 = 3", '"closed", "open" or "valve"'),
        ('[[scenarios]]\nkind = "open"', 'did you mean "open-loop"?'),
        ("[[scenarios]]\nkind = []", "known: closed-loop"),
        ("[[scenarios]]\nvalues = 3", "is no list"),
        ('[[scenarios]]\nvalues = ["1 V"]\ndwell = "0 s"', "above 0"),
        ('[[scenarios]]\nvalues = ["1 V"]\n[[scenarios]]\nvaluse = ["1 V"]', "key scenarios.2.valuse"),
        ('[[scenarios]]\nkind = "closed-loop"\nrefrence = "sine"', 'did you mean "reference"?'),
        ('[[scenarios]]\nkind = "closed-loop"\nname = 3', "a text"),
        ('[[scenarios]]\nkind = "closed-loop"\nduration = "-1 s"', "above 0"),
        ('[[scenarios]]\nkind = "monte-carlo"\nrun = 3', 'did you mean "runs"?'),
        ('[checks]\n"compar.error.test" = { max = 1 }', 'did you mean "compare"?'),
        ('[checks]\n"compare.eror.test" = { max = 1 }', 'did you mean "error"?'),
        ('[checks]\n"compare.error.tset" = { max = 1 }', 'did you mean "test"?'),
        ('[checks]\n"export.files" = { max = 1 }', '"export" has no answer to check'),
    ],
)
def test_what_is_misspelt_is_found_at_once(tmp_path: Path, more: str, says: str) -> None:
    with pytest.raises(InputError) as error:
        load_pipeline_file(edited(tmp_path, more))
    assert says in str(error.value)


def test_all_of_it_is_told_at_once(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="3 faults"):
        load_pipeline_file(edited(tmp_path, '[design]\na = 1\n[[scenarios]]\nb = 1\n[checks]\n"c.d" = { max = 1 }'))


def test_plugins_run_where_effects_are_needed_and_not_to_load_or_read(tmp_path: Path) -> None:
    (tmp_path / "own.py").write_text("raise RuntimeError('it runs')")
    (tmp_path / "raw.csv").write_text("t,p\n" + "".join(f"{0.01 * i},{i % 3}\n" for i in range(40)))
    path = tmp_path / "bench.toml"
    path.write_text(
        PIPELINE.replace("[model]", '[model]\nplugins = ["own.py"]').replace('"test"', '"train"\nu = "1 V"')
    )
    pipeline = open_pipeline(path, load_pipeline_file)
    pipeline.update(["ingest"])
    assert pipeline.stage_status(["ingest", "identify"])["ingest"].reasons == ()
    with pytest.raises(InputError, match="it runs"):
        pipeline.update(["identify"])


@pytest.mark.parametrize("stage", ["ingest", "identify", "compare"])
def test_checks_may_look_into_all_that_a_stage_answers(demo: Demo, stage: str) -> None:
    known_as_declared(stage, demo[1][stage])
