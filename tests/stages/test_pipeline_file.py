"""What is misspelt in the pipeline file is found when it is loaded, and not after minutes."""

from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from pneucli.config import load
from pneucli.diagnose.subsample import MAX_SAMPLES
from pneucli.errors import InputError
from pneucli.physics.effects import catalogue
from pneucli.pipeline.graph import STAGES, Context
from pneucli.pipeline.manifest import Stamp
from pneucli.pipeline.runner import open_pipeline
from pneucli.pipeline.workload import workload
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


# --- the counts of a stage's first line, and the units of its estimate


RECORDINGS = {"recordings": [{"samples": 30_000}, {"samples": 18_000}]}


@pytest.fixture
def context(tmp_path: Path) -> Context:
    """A stage of the demo after ``ingest``, with one effect in the model."""
    config = load(DEMO)
    config = config.model_copy(update={"model": config.model.model_copy(update={"effects": ["supply-droop"]})})
    return Context(DEMO, config, tmp_path, tmp_path, answers={"ingest": RECORDINGS})


def of(context: Context, samples: int) -> Context:
    """The same with one recording of that many samples."""
    return replace(context, answers={"ingest": {"recordings": [{"samples": samples}]}})


@pytest.mark.parametrize(
    ("stage", "text"),
    [
        ("ingest", "2 files, 3.5 MB"),
        ("identify", "2 recordings, 48,000 samples, 1 effect in the model"),
        ("diagnose", f"{len(catalogue()) - 1} effects on 2 recordings, 48,000 samples"),
        ("simulate", "2 recordings"),
        ("report", "2 recordings"),
        ("plan", f"{len(catalogue()) - 1} effects"),
    ],
)
def test_a_stage_counts_what_decides_how_long_it_takes(context: Context, stage: str, text: str) -> None:
    files = {"a.csv": Stamp(2_000_000, 0, ""), "b.csv": Stamp(1_500_000, 0, "")}
    assert workload(stage, context, files).text == text


@pytest.mark.parametrize("stage", STAGES)
def test_every_stage_has_units_above_0_even_of_an_empty_pipeline(context: Context, stage: str) -> None:
    assert workload(stage, replace(context, answers={"ingest": {"recordings": []}}), {}).units > 0


def test_units_grow_with_samples_and_effects(context: Context) -> None:
    assert workload("compare", of(context, 2_000), {}).units == 2 * workload("compare", of(context, 1_000), {}).units
    fewer = replace(context, options={"exclude": ["stribeck"]})
    assert workload("diagnose", fewer, {}).units < workload("diagnose", context, {}).units
    most = workload("diagnose", of(context, MAX_SAMPLES), {}).units
    assert workload("diagnose", of(context, 9 * MAX_SAMPLES), {}).units == most


@pytest.mark.parametrize(
    ("scenarios", "text"),
    [
        ([], "112 Monte Carlo runs"),
        ([{"kind": "monte-carlo", "runs": 40}, {"kind": "closed-loop"}], "40 Monte Carlo runs"),
        ([{"kind": "monte-carlo", "runs": "many"}], "2 recordings"),  # the stage refuses it
        ([{"kind": "closed-loop"}], "2 recordings"),
    ],
)
def test_a_designed_loop_is_run_as_often_as_the_file_says(
    context: Context, scenarios: list[dict[str, Any]], text: str
) -> None:
    config = context.config.model_copy(update={"scenarios": scenarios})
    designed = replace(context, config=config, answers={"ingest": RECORDINGS, "design": {}})
    assert workload("simulate", designed, {}).text == text
