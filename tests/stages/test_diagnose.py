"""The stage ``diagnose`` on recordings whose hidden physics is known."""

import json
from collections.abc import Sequence
from dataclasses import replace
from itertools import pairwise
from pathlib import Path
from types import SimpleNamespace
from typing import Any, get_args

import numpy as np
import pytest

from pneucli import messages
from pneucli.config import load
from pneucli.diagnose.adequacy import LackOfFit
from pneucli.diagnose.candidate import Decision, Reason
from pneucli.diagnose.diagnosis import Confidence
from pneucli.diagnose.free_run_error import FreeRunErrors
from pneucli.diagnose.score import ErrorsByUse
from pneucli.diagnose.subsample import MIN_REDUCTION
from pneucli.errors import InputError
from pneucli.exam.cases import generate_case
from pneucli.figure import Figure, read, to_json
from pneucli.identify.estimation.fit import Estimate, Fit
from pneucli.identify.residuals import ChamberPressures, ResidualModel
from pneucli.io.artifacts import read_table
from pneucli.messages.diagnose import MIN_TOLD_PROBABILITY, Answer, verdict_sentence
from pneucli.messages.formatting import format_noise_ratio
from pneucli.physics.effects import catalogue_with_sides
from pneucli.pipeline.graph import Context
from pneucli.plausibility.rig_check import contradictions
from pneucli.simulate.model import Model
from pneucli.stages import diagnose, identify, ingest, pipeline_data
from pneucli.stages.diagnosis_answer import proposed_experiment
from pneucli.stages.pipeline_data import PipelineData
from tests.diagnose.candidates import candidate, diagnosis_data
from tests.plausibility.faulty_data_sets import MM_AS_M, P2, SETS, A, Mistake, Rig, X, held, stated
from tests.stages.chain import known_as_declared, run_stages

Diagnosed = tuple[Path, dict[str, Any]]

FIXTURES = Path(__file__).parents[2] / "fixtures"


def diagnosed(pipeline: Path, out: Path, *exclude: str, **options: Any) -> dict[str, Any]:
    """Ingest and diagnose, as the runner does it."""
    config = load(pipeline)
    answers: dict[str, dict[str, Any]] = {}
    for name, stage in (("ingest", ingest), ("diagnose", diagnose)):
        (out / name).mkdir(parents=True)
        context = Context(pipeline, config, out / name, out, answers=answers, options={"exclude": exclude, **options})
        answers[name] = stage.run(context)
    return answers["diagnose"]


@pytest.fixture(scope="module")
def hysteresis(tmp_path_factory: pytest.TempPathFactory) -> Diagnosed:
    out = tmp_path_factory.mktemp("hysteresis")
    return out, diagnosed(FIXTURES / "friction_hysteresis" / "pipeline.toml", out)


def test_the_answer_has_the_interfaces_keys(hysteresis: Diagnosed) -> None:
    answer = hysteresis[1]
    json.dumps(answer, allow_nan=False)
    known_as_declared("diagnose", answer)
    assert answer["schema"] == "pneucli/diagnose/1"
    assert answer["plausibility"] == []
    for one in answer["candidates"]:
        for parameter in one["parameters"].values():
            assert parameter.keys() == {"value", "unit", "ci95"}
            low, high = parameter["ci95"]
            assert (low is None) == (high is None) == (not is_told(one))
            assert not is_told(one) or low <= parameter["value"] <= high


def is_told(candidate: dict[str, Any]) -> bool:
    """Whether the sentences of an answer may speak of a candidate: only then is its error simulated."""
    return candidate["supported"] or (candidate["confidence"] or 0.0) >= MIN_TOLD_PROBABILITY


def test_errors_of_long_recordings_are_those_of_the_whole(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Fits may see segments; what ``compare`` says of the model is an error of all samples."""
    compared: list[int] = []

    class Errors(FreeRunErrors):
        def __call__(self, model: Model, reference: Model | None = None) -> ErrorsByUse:
            compared.append(sum(e.time.size for e in self.experiments))
            return super().__call__(model, reference)

    monkeypatch.setattr(pipeline_data, "MAX_SAMPLES", 6500)
    monkeypatch.setattr(diagnose, "FreeRunErrors", Errors)
    answer = diagnosed(FIXTURES / "friction_hysteresis" / "pipeline.toml", tmp_path)
    assert answer["thinned"]["used"] < 0.7 * answer["thinned"]["samples"]
    assert set(compared) == {answer["thinned"]["samples"]}


@pytest.mark.parametrize(("samples", "is_whole"), [(6_999, False), (7_000, True)])
def test_segments_are_fitted_where_they_halve_the_samples(samples: int, is_whole: bool) -> None:
    """Else two fits of the given model, of all samples and of some, were two errors of it for little time saved."""

    class Recorded(PipelineData):
        @property
        def recordings(self) -> Any:
            return [SimpleNamespace(time=np.zeros(size)) for size in (4_000, 10_000)]

    study = Recorded(SimpleNamespace())  # type: ignore[arg-type]
    chosen = study.at_most(samples, by_at_least=MIN_REDUCTION)
    assert (chosen is study, chosen.max_samples) == (is_whole, None if is_whole else samples)


def test_the_hidden_effect_is_named_with_its_size(hysteresis: Diagnosed) -> None:
    """Size: ``fixtures/truth.json``; a tenth off is what 14 s of recordings with the rig's noise leave open."""
    answer = hysteresis[1]
    assert (answer["verdict"], answer["missing"]) == ("missing-effect", ["friction-hysteresis"])
    truth = json.loads((FIXTURES / "truth.json").read_text())["friction_hysteresis"]["parameters"]
    (named,) = [c for c in answer["candidates"] if c["effect"] == "friction-hysteresis"]
    assert named["supported"]
    assert named["parameters"]["drop"]["value"] == pytest.approx(truth["drop"], rel=0.1)


def test_parameters_of_the_fit_of_all_recordings_have_the_intervals_of_every_estimate(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    """Those by blocks of time alone are too narrow where the model misses something."""
    fitted_to = list[int]()

    def widened(fitted: Fit, residual_models: Sequence[ResidualModel]) -> Fit:
        fitted_to.append(len(residual_models))
        return replace(fitted, estimates=(Estimate("volume", "m^3", 2.0, 0.5, (1.0, 3.0), at_bound=False),))

    monkeypatch.setattr(diagnose, "with_intervals", widened)
    answer = diagnosed(FIXTURES / "valve_null" / "pipeline.toml", tmp_path)
    assert answer["parameters"] == {"volume": {"value": 2.0, "unit": "m^3", "ci95": [1.0, 3.0]}}
    assert fitted_to == [len(load(FIXTURES / "valve_null" / "pipeline.toml").recordings)]


class Started(Exception):  # noqa: N818 - it ends a stage, and tells where its fit starts
    """A fit was to start from a model."""

    def __init__(self, model: Model) -> None:
        super().__init__()
        self.model = model


def test_identify_and_diagnose_fit_from_the_same_start_to_the_last_digit(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    """Where a fit has several minima, a start that differs in its last digit gives one model two errors."""

    def start(model: Model, *_: object, **__: object) -> Fit:
        raise Started(model)

    path, starts = FIXTURES / "demo" / "pipeline.toml", list[Model]()
    config, answers = load(path), {}
    (tmp_path / "ingest").mkdir()
    answers["ingest"] = ingest.run(Context(path, config, tmp_path / "ingest", tmp_path))
    for stage in (identify, diagnose):
        monkeypatch.setattr(stage, "fit_model", start)
        with pytest.raises(Started) as started:
            stage.run(Context(path, config, tmp_path, tmp_path, answers=answers))
        starts.append(started.value.model)
    assert starts[0].values == starts[1].values
    assert starts[0].valves == starts[1].valves


def test_what_is_named_is_sure_and_what_is_not_is_less_so(hysteresis: Diagnosed) -> None:
    """What helps takes a share of the squares beyond noise: here nearly all of them, by one effect."""
    by_effect = {c["effect"]: c for c in hysteresis[1]["candidates"]}
    named = by_effect["friction-hysteresis"]
    assert named["confidence"] > 0.5
    assert named["share"] > 0.95
    alike = {"friction-hysteresis", *named["indistinguishable_from"]}
    assert sum(by_effect[n]["confidence_alone"] for n in alike) == pytest.approx(named["confidence"], abs=1e-3)
    for c in by_effect.values():
        assert 0.0 <= c["confidence_alone"] <= c["confidence"] <= 1.0
        assert c["effect"] in alike or c["confidence"] < 0.5
        assert (c["residual_share"] is None) == (not c["parameters"])  # only a fit tells it
        assert (c["share"] is not None) == (bool(c["parameters"]) and is_told(c))


def test_what_remains_is_told_by_channel(hysteresis: Diagnosed) -> None:
    left = hysteresis[1]["discrepancy"]
    keys = {"subsystem", "channel", "size", "time_constant_s", "over", "share"}
    assert all(one.keys() == keys for one in left)
    assert not left or sum(one["share"] for one in left) == pytest.approx(1.0)


def test_what_the_parameters_leave_open_is_said_and_what_to_record() -> None:
    open_, fits, missed = (
        LackOfFit(ChamberPressures, name, ratio, ratio, (), 4.7)
        for name, ratio in (("p1", 7.7), ("p2", 1.1), ("p2", 77.0))
    )
    (said,) = diagnose.parameter_uncertainty_warnings([open_, fits, missed])
    assert "p1 of recordings that were not fitted errs by 7.7 times its noise" in said
    assert "record such commands or speeds" in said


def test_the_answer_has_the_sentence_of_its_own_numbers(hysteresis: Diagnosed) -> None:
    answer = hysteresis[1]
    assert answer["sentence"] == verdict_sentence(read(Answer, answer))
    assert answer["sentence"].startswith("The model lacks friction-hysteresis (less dry friction while slowing")
    assert format_noise_ratio(answer["ladder"][-1]["error_test"]) in answer["sentence"]


@pytest.mark.parametrize(
    ("name", "words"),
    [
        ("friction, s declared as ms", "times the second derivative of x"),
        ("valve, p_supply a tenth", "from a supply of 1.61 bar"),
    ],
)
def test_no_verdict_is_given_on_recordings_that_cannot_be_true(name: str, words: str, tmp_path: Path) -> None:
    """The finding comes first, nothing is named or suggested; with --force it is looked for all the same."""
    pipeline = SETS[name].make(noise=True).write(tmp_path)
    answer = diagnosed(pipeline, tmp_path / "out")
    assert (answer["verdict"], answer["missing"], answer["unexplained"]) == ("inconclusive", [], None)
    assert words in answer["sentence"]
    assert answer["sentence"].endswith("Recordings contradict the stated rig: no effect was looked for.")
    text = messages.render("diagnose", answer, "a.toml", verbose=False)
    assert "pneucli diagnose a.toml --force" in text
    assert "--suggested" not in text


def test_compare_and_diagnose_state_the_same_error_of_a_model(tmp_path: Path) -> None:
    """Recordings with a wrong supply, so that fits of different costs end at different models."""
    pipeline = SETS["valve, p_supply a tenth"].make(noise=True).write(tmp_path)
    given = diagnosed(pipeline, tmp_path / "diagnosed")["ladder"][0]
    error = run_stages(pipeline, tmp_path / "compared")["compare"]["error"]
    assert given["error_train"] == pytest.approx(error["train"], rel=1e-9)
    assert given["error_test"] == (None if error["test"] is None else pytest.approx(error["test"], rel=1e-9))


def test_an_answer_on_impossible_recordings_can_be_forced(tmp_path: Path) -> None:
    pipeline = SETS["valve, p_supply a tenth"].make(noise=True).write(tmp_path)
    answer = diagnosed(pipeline, tmp_path / "out", force=True)
    assert answer["forced"]
    assert answer["impossible"] == []
    assert answer["plausibility"]
    assert answer["verdict"] != "inconclusive"


def test_the_ladder_falls_to_the_noise_floor(hysteresis: Diagnosed) -> None:
    """True models of stick and slip end between 0.7 and 1.3: a break-away is chance (docs/compare.md)."""
    first, last = hysteresis[1]["ladder"]
    assert (first["add"], last["add"]) == (None, "friction-hysteresis")
    for error in ("error_train", "error_test"):
        assert last[error] < 1.3
        assert first[error] > 5.0
    assert hysteresis[1]["unexplained_share"] < 0.01


def test_the_tables_say_what_the_answer_says(hysteresis: Diagnosed) -> None:
    out, answer = hysteresis
    ladder = read_table(out / "diagnose" / "ladder.parquet")
    assert list(ladder["add"]) == [step["add"] or "" for step in answer["ladder"]]
    assert list(ladder["error_test"]) == [step["error_test"] for step in answer["ladder"]]
    table = read_table(out / "diagnose" / "candidates.parquet")
    rows = zip(table["effect"], table["parameter"], table["value"], table["missing"], strict=True)
    said = [
        (c["effect"], name, p["value"], c["effect"] in answer["missing"])
        for c in answer["candidates"]
        for name, p in c["parameters"].items()
    ]
    assert [row for row in rows if row[1]] == said
    assert dict(zip(table["effect"], table["reason"], strict=True)) == {
        c["effect"]: c["reason"] for c in answer["candidates"]
    }


def test_what_is_excluded_is_not_named(tmp_path: Path) -> None:
    """Something else may help, but nothing of the catalogue explains the loop as well: something remains."""
    answer = diagnosed(FIXTURES / "friction_hysteresis" / "pipeline.toml", tmp_path, "friction-hysteresis")
    tried = [c["effect"] for c in answer["candidates"] if c["parameters"]]
    assert tried
    assert "friction-hysteresis" not in [*tried, *answer["missing"], *(d["effect"] for d in answer["detectable"])]
    assert answer["verdict"] == "unexplained"
    assert answer["unexplained"]["subsystem"].startswith("mechanics")


def test_excluding_what_does_not_exist_is_refused_with_a_mend(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="--exclude") as refused:
        diagnosed(FIXTURES / "valve_null" / "pipeline.toml", tmp_path, "pistonleak")
    assert refused.value.mend == 'did you mean "piston-leak"?'


@pytest.mark.parametrize("fixture", ["valve_null", "friction_null_coulomb"])
def test_where_nothing_is_hidden_nothing_is_named(tmp_path: Path, fixture: str) -> None:
    answer = diagnosed(FIXTURES / fixture / "pipeline.toml", tmp_path)
    assert (answer["verdict"], answer["missing"]) == ("adequate", [])
    assert [step["add"] for step in answer["ladder"]] == [None]
    sizes = {d["effect"]: d["size"] for d in answer["detectable"]}
    assert any(size is not None and size > 0.0 for size in sizes.values())  # absent, not merely out of sight
    where = {d["effect"]: [at["parameter"] for at in d["where"]] for d in answer["detectable"] if d["size"]}
    assert where.get("end-cushion", ["length"]) == ["length"]


def test_exact_twins_are_reported_as_a_set(tmp_path: Path) -> None:
    """With measured pressures as inputs an offset of p1 is area times offset: the same force at all times."""
    generate_case(tmp_path / "case", "friction", ["constant-force"], "", 1.0, 5)
    answer = diagnosed(tmp_path / "case" / "pipeline.toml", tmp_path / "out")
    assert answer["verdict"] == "missing-effect"
    (name,) = answer["missing"]
    (named,) = [c for c in answer["candidates"] if c["effect"] == name]
    assert {"constant-force", "pressure-offset"} <= {name, *named["indistinguishable_from"]}
    assert "Vent both chambers" in answer["next_experiment"]


@pytest.mark.parametrize(
    ("missing", "confidence", "shown", "interval"),
    [
        ((), 0.4, "wide fit with a", [1.0, 2.0]),
        (("a", "b"), 0.9, "fit with a and b over all models", [1.0, 2.0]),
        ((), 0.1, "fit with a", [None, None]),
    ],
)
def test_an_effect_that_is_told_has_the_interval_of_the_model_that_it_is_told_of(
    monkeypatch: pytest.MonkeyPatch, missing: tuple[str, ...], confidence: float, shown: str, interval: list[Any]
) -> None:
    """Intervals of a model with unmodelled effects are wide; narrower ones would contradict the reason. What no
    sentence tells has none, and no error: both take longer than its fit.
    """
    monkeypatch.setattr(diagnose, "_parameters", lambda pipeline, fit, name: {"size": Figure(1.5, 1.0, 2.0, fit)})
    effect = SimpleNamespace(name="a", title="An effect", looks_like="")
    reduced = SimpleNamespace(model="m", effect_names=["stribeck", "b"], cost=100.0)
    candidate = SimpleNamespace(full=SimpleNamespace(model="m", fit="fit with a", cost=25.0), reduced=reduced)
    reason = "supported" if missing else "interval-contains-null"
    decision: Any = SimpleNamespace(effect=effect, candidate=candidate, reason=reason, supported=bool(missing))
    data: Any = SimpleNamespace(
        free_run_errors=lambda model: {"train": 2.0, "test": 2.0},
        with_intervals=lambda fitted: f"wide {fitted.fit}",
        held_out="test",
        folds=(),
    )
    equivalents: Any = dict.fromkeys(missing, ())
    found: Any = SimpleNamespace(
        missing=missing,
        equivalents=equivalents,
        confidence={"a": Confidence(confidence, confidence)},
        evidence={},
        fit="fit with a and b over all models",
        path=SimpleNamespace(models=[SimpleNamespace(effect_names=["stribeck"])]),
    )
    pipeline: Any = None
    answer = diagnose._candidate_answer(pipeline, data, found, decision)
    assert to_json(answer.parameters) == {"size": {"value": 1.5, "unit": shown, "ci95": interval}}
    assert answer.residual_share == 0.75
    assert answer.error_after == (None if interval == [None, None] else 2.0)
    assert answer.beside == ["b"]


def test_no_rung_raises_both_errors_and_each_entry_has_its_reason(hysteresis: Diagnosed) -> None:
    answer = hysteresis[1]
    for before, after in pairwise(answer["ladder"]):
        assert any(after[error] <= before[error] for error in ("error_train", "error_test"))
    effects = [c["effect"] for c in answer["candidates"]]
    assert len(effects) == len(set(effects))
    given = set(answer["model"]["effects"])
    assert set(effects) == set(catalogue_with_sides()) - given  # nothing is passed over in silence
    for c in answer["candidates"]:
        assert c["reason"] in get_args(Reason)
        assert c["supported"] == (c["reason"] == "supported")
    felt = {c["effect"]: c for c in answer["candidates"] if c["reason"] == "cannot-show"}
    assert "valve-lag" in felt  # pressures were imposed: no valve
    assert felt["valve-lag"]["error_after"] == felt["valve-lag"]["error_before"]


def test_without_test_recordings_each_is_held_out_in_turn(tmp_path: Path) -> None:
    """In one of them the piston hardly moves: held out alone, it would contradict everything and support nothing."""
    source = FIXTURES / "friction_hysteresis"
    text = (source / "pipeline.toml").read_text().replace('use = "test"', 'use = "train"')
    for raw in source.glob("*.csv"):
        (tmp_path / raw.name).write_bytes(raw.read_bytes())
    (tmp_path / "pipeline.toml").write_text(text)
    answer = diagnosed(tmp_path / "pipeline.toml", tmp_path / "out")
    assert (answer["verdict"], answer["missing"]) == ("missing-effect", ["friction-hysteresis"])
    assert answer["held_out"] == "by turns"
    assert "held out in turn" in answer["warnings"][0]
    assert all(step["error_test"] is None for step in answer["ladder"])


# --- which experiment an answer proposes


def dropped(effect: str, probability: float) -> Any:
    tried = candidate(effect)
    return SimpleNamespace(decision=Decision(tried.effect, "explained-by-unknown", tried), probability=probability)


@pytest.mark.parametrize(
    ("probabilities", "tested"),
    [((0.45, 0.35), ["stribeck", "constant-force"]), ((0.45, 0.05), ["stribeck"]), ((0.2, 0.1), [])],
)
def test_with_a_discrepancy_the_effects_that_are_about_as_probable_as_not_are_tested(
    probabilities: tuple[float, float], tested: list[str]
) -> None:
    refused = [dropped("constant-force", probabilities[1]), dropped("stribeck", probabilities[0])]
    rest = SimpleNamespace(channel="force", subsystem="mechanics", variable="p1")
    found: Any = SimpleNamespace(missing=(), equivalents={}, path=SimpleNamespace(refused=refused), unexplained=rest)
    proposed = proposed_experiment(diagnosis_data(), found)
    assert proposed is not None
    assert [part.partition(":")[0] for part in proposed.split("To test ")[1:]] == tested
    assert "The discrepancy is in force (mechanics)." in proposed


# --- a contradiction leaves out the recording or the signal that it concerns, and says so; a doubt leaves out nothing


BOTH_FITTED = stated('(name = "stickslip_2"(?:.*\n)*?use = )"test"', r'\1"train"')


def pipeline_of(mistake: Mistake, folder: Path, **options: Any) -> PipelineData:
    """Return the data of a rig on which stickslip_2 and driven_1 are fitted and driven_2 is held out."""
    path = mistake(BOTH_FITTED(Rig.of("friction", noise=True))).write(folder)
    config, out = load(path), folder / "out"
    answer = ingest.run(Context(path, config, out / "ingest", out))
    return PipelineData(Context(path, config, out / "none", out, answers={"ingest": answer}, options=options))


def left_out(pipeline: PipelineData) -> list[tuple[str | None, str | None]]:
    return [(part.recording, part.signal) for part in pipeline.contradicted]


def test_one_false_recording_is_left_out_and_the_others_are_used(tmp_path: Path) -> None:
    pipeline = pipeline_of(held(P2, 2.0, "driven_1"), tmp_path)
    assert [one.name for one in pipeline.recordings] == ["stickslip_2", "driven_2"]
    assert left_out(pipeline) == [("driven_1", None)]
    assert pipeline.impossible == []


def test_of_a_dead_derivative_the_signal_alone_is_left_out(tmp_path: Path) -> None:
    pipeline = pipeline_of(held(A, 0.0, "driven_1"), tmp_path)
    assert ["a" in one for one in pipeline.recordings] == [True, False, True]
    assert left_out(pipeline) == [("driven_1", "a")]
    assert pipeline.impossible == []


def test_where_nothing_else_is_left_to_fit_all_are_used_and_called_impossible(tmp_path: Path) -> None:
    pipeline = pipeline_of(MM_AS_M, tmp_path)
    assert len(pipeline.recordings) == 3
    assert left_out(pipeline) == []
    assert {one.recording for one in pipeline.impossible} == {"stickslip_2", "driven_1", "driven_2"}


@pytest.mark.parametrize("options", [{}, {"force": True}])
def test_force_and_doubts_leave_nothing_out(options: dict[str, Any], tmp_path: Path) -> None:
    mistake = held(P2, 2.0, "driven_1") if options else held(X, 100.0, "driven_2")
    pipeline = pipeline_of(mistake, tmp_path, **options)
    found = pipeline.ingested.plausibility
    assert found
    assert bool(contradictions(found)) == bool(options)
    assert len(pipeline.recordings) == 3
    assert (pipeline.contradicted, pipeline.impossible) == ([], [])


def test_errors_of_other_recordings_are_errors_of_other_data(tmp_path: Path) -> None:
    (tmp_path / "a").mkdir()
    (tmp_path / "b").mkdir()
    mistake = held(P2, 2.0, "driven_1")
    fewer = pipeline_of(mistake, tmp_path / "a").data_digest
    assert fewer != pipeline_of(mistake, tmp_path / "b", force=True).data_digest
