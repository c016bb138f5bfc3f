"""The verdict first, in bar, mm and mm/s: what was found, how sure, what it changes, what to do."""

from __future__ import annotations

from typing import Any

import pytest

from pneucli import messages
from pneucli.messages import compare, diagnose, history, ingest, simulate, verdict
from pneucli.messages import run as summary


def region(channel: str, signal: str, low: float, high: float, unit: str, event: int) -> dict[str, Any]:
    where = {"recording": "driven_2", "channel": channel, "signal": signal, "from": low, "to": high, "unit": unit}
    return {**where, "share_of_error": 0.61, "share_of_samples": 0.10, "event": event}


def finding(recording: str, weight: str) -> dict[str, Any]:
    words = {"found": "p2 rests at 0.01 bar", "mend": "gauge?"}
    return {"check": "reference", "signal": "p2", "recording": recording, "weight": weight, **words}


def test_findings_say_what_is_left_out_then_what_conflicts_then_what_is_doubtful() -> None:
    """A doubt about a recording is not taken for a contradiction in another one."""
    answer = {"plausibility": [finding("b", "doubt"), finding("a", "contradiction"), finding("c", "contradiction")]}
    said = "p2 rests at 0.01 bar; gauge?"
    assert list(ingest.plausibility_lines(answer)) == [f"conflict a and 1 more, {said}", f"doubt    b, {said}"]
    left_out = [{"recording": "c", "signal": None}, {"recording": "a", "signal": "v"}]
    said_of_each = [f"left out c, {said}", f"conflict a, {said}", f"doubt    b, {said}"]
    assert list(ingest.plausibility_lines(answer, left_out)) == said_of_each
    assert list(ingest.plausibility_lines({})) == []


def channel(name: str, ratio: float, use: str = "test") -> dict[str, Any]:
    of = {"recording": "driven_2", "use": use, "channel": name, "unit": "m", "rmsd": 5.31e-3, "percent": 5.6}
    return {**of, "ratio_to_noise": ratio}


COMPARED = {
    "error": {"train": 12.0, "test": 20.6},
    "channels": [channel("x", 25.4), channel("v", 1.1)],
    "where": [
        region("v", "v", -0.035, 0.0, "m/s", 0),
        region("x", "time", 3.1, 3.6, "s", 0),
        region("a", "direction", -1.0, -0.9, "1", 0),
        region("v", "x", 0.1, 0.12, "m", 1),
    ],
}
LEAK = {"area": {"value": 1e-7, "unit": "m^2", "ci95": [0.9e-7, 1.1e-7]}}
DIAGNOSED: dict[str, Any] = {
    "verdict": "missing-effect",
    "missing": ["piston-leak"],
    "sentence": "The model lacks piston-leak (leak across the piston): with it the error falls.",
    "ladder": [
        {"add": None, "error_train": 14.0, "error_test": 18.1},
        {"add": "piston-leak", "error_train": 1.1, "error_test": 0.834},
    ],
    "candidates": [
        {
            "effect": "piston-leak",
            "title": "Leak across the piston",
            "parameters": LEAK,
            "indistinguishable_from": [],
            "error_after": 0.834,
            "why": "It explains the creep.",
        }
    ],
    "moved": [{"parameter": "valve.overlap_fill", "from": 0.475, "to": 0.206, "unit": "V", "plausible": False}],
    "detectable": [{"effect": "chamber-leak", "parameter": "area", "size": 3e-10, "unit": "m^2", "would_show": "so"}],
    "unexplained_share": 0.0,
    "next_experiment": None,
    "warnings": [],
}
ADEQUATE = DIAGNOSED | {"verdict": "adequate", "missing": [], "ladder": DIAGNOSED["ladder"][1:], "candidates": []}


def one_line(text: str) -> str:
    return " ".join(text.split())


@pytest.mark.parametrize(("error", "told"), [(1.1, True), (5.0, False)])
def test_a_free_run_is_told_where_the_printed_error_does_not_say_so(error: float, told: bool) -> None:
    drifting = {"recording": "charge_1", "channel": "p1", "percent": 14.2, "ratio_to_noise": 31.0}
    judged = {"present": True, "undetermined": False, "error": error, "limit": 1.2, "worst": None}
    answer = COMPARED | {"error": {"train": None, "test": error}, "lack_of_fit": judged, "free_run": [drifting]}
    said = "Over the whole recording charge_1, p1 drifts by 14 % of its range (31.0 × noise)."
    assert (said in one_line(messages.render("compare", answer, "p.toml"))) == told
    found = {"verdict": "unexplained", "missing": [], "ladder": DIAGNOSED["ladder"], "candidates": []}
    assert (said in verdict.verdict_sentence(found | {"lack_of_fit": judged, "free_run": [drifting]})) == told


@pytest.mark.parametrize(("within", "told"), [(9.9, True), (18.0, False), (None, False)])
def test_held_out_errors_beyond_the_fitted_range_are_told(within: float | None, told: bool) -> None:
    beyond = {"recording": "trace_4", "signal": "u", "share": 0.1, "from": 8.03, "to": 10.0, "unit": "V"}
    answer = COMPARED | {"beyond_fitted": [beyond | {"share_of_error": 0.9}], "error_within_fitted": within}
    said = (
        "trace_4 goes beyond the fitted recordings: valve command to 10.0 V, fitted to 8.03 V. Within their range the "
        "error is 9.90 × noise; for more, fit such recordings, too."
    )
    assert (said in one_line(messages.render("compare", answer, "p.toml"))) == told
    found = {"verdict": "unexplained", "missing": [], "ladder": DIAGNOSED["ladder"], "candidates": []}
    assert (said in verdict.verdict_sentence(answer | found)) == told


def test_compare_says_error_worst_channel_events_and_what_to_do() -> None:
    assert messages.render("compare", COMPARED, "p.toml").splitlines()[0] == (
        "error    20.6 × noise on test recordings (12.0 on those fitted): the model misses something"
    )
    told = one_line(messages.render("compare", COMPARED, "p.toml"))
    assert "worst x in driven_2, 25.4 × noise (5.31 mm rms)" in told
    assert "where driven_2: v, x and a at time 3.10 to 3.60 s, piston velocity −35.0 to 0 mm/s; 61 % of" in told
    assert told.endswith("do pneucli diagnose p.toml")


def test_one_event_over_several_signals_is_one_line() -> None:
    assert [len(event) for event in compare.grouped_regions(COMPARED)] == [3, 1]
    assert messages.render("compare", COMPARED, "p.toml").count("driven_2: ") == 2


def test_verbose_prints_the_table_of_channels() -> None:
    assert "rms error" not in messages.render("compare", COMPARED, "p.toml")
    assert "driven_2   test  x          5.31 mm" in messages.render("compare", COMPARED, "p.toml", verbose=True)


@pytest.mark.parametrize(
    ("errors", "said"),
    [
        ({"train": 1.0, "test": 1.1}, "at the noise floor"),
        ({"train": 1.0, "test": 1.5}, "comes near the noise"),
        ({"train": 5.0, "test": None}, "none was held out: the model misses something"),
        ({"train": None, "test": None}, "no channel was compared"),
    ],
)
def test_the_verdict_of_a_comparison(errors: dict[str, float | None], said: str) -> None:
    assert said in compare.verdict({"error": errors})


JUDGED = {"present": False, "undetermined": False, "use": "test", "p": 0.2, "error": 1.5, "limit": 1.62, "worst": None}


def compared(error: float = 1.5, **judged: object) -> dict[str, Any]:
    """An answer of ``compare`` with its judgement."""
    return {"error": {"train": 1.0, "test": error}, "lack_of_fit": JUDGED | {"error": error} | judged}


def test_an_error_that_a_correct_model_may_have_counts_as_noise() -> None:
    assert compare.verdict(compared()) == (
        "1.50 × noise on test recordings (1.00 on those fitted; of correct models 99 % are below 1.62): "
        "the model stands at the noise floor"
    )
    worst = {"recording": "axis_1", "channel": "p1", "ratio_to_noise": 2.4}
    near = compare.verdict(compared(present=True, limit=1.4, worst=worst))
    assert near.endswith("the model comes near the noise and misses something, in p1 of axis_1 most")
    assert compare.verdict(compared(9.0, present=True, limit=1.4)).endswith(
        "on those fitted): the model misses something"
    )
    assert "too uncertain to tell" in compare.verdict(compared(30.5, undetermined=True, limit=40.0))
    assert "below 1.62 with one segment beside a break-away)" in compare.verdict(compared(excused=1))


@pytest.mark.parametrize(
    ("judged", "rating", "command"),
    [
        (compared(), "good", "pneucli run"),
        (compared(1.3, present=True), "", "pneucli diagnose"),
        (compared(9.0, present=True), "bad", "pneucli diagnose"),
        (compared(9.0, undetermined=True), "", "pneucli diagnose"),
    ],
)
def test_rating_and_next_step_follow_from_the_one_judgement(judged: dict[str, Any], rating: str, command: str) -> None:
    assert compare.overall_rating(judged) == rating
    (do,) = [line for line in compare.lines(judged, "a.toml", verbose=False) if line.startswith("do ")]
    assert do.split(None, 1)[1] == f"{command} a.toml"


def test_a_channel_within_its_limit_is_not_the_worst() -> None:
    channels = [
        {"recording": "slip", "channel": "x", "rmsd": 1e-3, "unit": "m", "ratio_to_noise": 2.9, "ratio_limit": 3.1},
        {"recording": "step", "channel": "p1", "rmsd": 1e3, "unit": "Pa", "ratio_to_noise": 2.2, "ratio_limit": 1.1},
    ]
    assert compare.worst_channel_sentence({"channels": channels}).startswith("p1 in step, 2.20 × noise")
    assert not compare.worst_channel_sentence({"channels": channels[:1]})


@pytest.mark.parametrize(
    ("low", "high", "said"),
    [(0.9, 1.0, "toward +x"), (-1.0, -0.9, "toward −x"), (-0.1, 0.0, "at rest"), (-1.0, 0.1, "toward −x or at rest")],
)
def test_directions_are_words(low: float, high: float, said: str) -> None:
    assert compare.region_span({"signal": "direction", "from": low, "to": high, "unit": "1"}) == said


def test_diagnose_states_the_verdict_its_evidence_changes_and_the_next_step() -> None:
    told = one_line(messages.render("diagnose", DIAGNOSED, "p.toml"))
    assert told.startswith("found The model lacks piston-leak (leak across the piston): with it the error falls. ")
    assert "evidence piston-leak area = 0.100 ± 0.010 mm²; no other effect of the catalogue explains" in told
    assert "changes valve.overlap_fill 0.475 V → 0.206 V (at its bound)" in told
    assert told.endswith("do pneucli add p.toml --suggested")


def test_an_error_that_falls_by_less_than_its_digits_show_stays() -> None:
    steps = [DIAGNOSED["ladder"][0] | {"error_test": 14.72}, DIAGNOSED["ladder"][1] | {"error_test": 14.69}]
    told = verdict.error_reduction(DIAGNOSED | {"ladder": steps})
    assert told == "the error stays at 14.7 × noise on recordings that were not fitted"


def test_a_base_parameter_that_stays_at_its_bound_has_one_value() -> None:
    moved = [DIAGNOSED["moved"][0] | {"to": DIAGNOSED["moved"][0]["from"]}]
    told = one_line(messages.render("diagnose", DIAGNOSED | {"moved": moved}, "p.toml"))
    assert "changes valve.overlap_fill 0.475 V (at its bound)" in told


def test_a_tried_effect_has_its_error_with_the_effects_of_its_model() -> None:
    tried = DIAGNOSED["candidates"][0] | {"effect": "presliding", "beside": ["stribeck"], "error_after": 2.5}
    told = one_line(messages.render("diagnose", DIAGNOSED | {"candidates": [tried]}, "p.toml", verbose=True))
    assert "error with presliding and stribeck 2.50 × noise" in told


def test_effects_after_the_last_named_one_do_not_count_in_its_reduction() -> None:
    tried = [*DIAGNOSED["ladder"], {"add": "presliding", "error_train": 0.5, "error_test": 5.0}]
    assert "from 18.1 to 0.83" in verdict.error_reduction(DIAGNOSED | {"verdict": "unexplained", "ladder": tried})
    nothing = DIAGNOSED | {"verdict": "unexplained", "missing": [], "ladder": tried}
    assert verdict.error_reduction(nothing) == "the error is 18.1 × noise on recordings that were not fitted"
    assert diagnose.evidence_summary(nothing) == ""


def test_an_adequate_model_states_its_detection_limits() -> None:
    told = one_line(messages.render("diagnose", ADEQUATE, "p.toml"))
    assert "1 of 1 other effects are detectable, such as chamber-leak (area 0.00030 mm²)" in told
    cushion = {"effect": "end-cushion", "parameter": "damping", "size": 8.3, "unit": "N s/m"}
    somewhere = [cushion | {"where": [{"parameter": "length", "value": 0.08, "unit": "m"}]}]
    told = diagnose.evidence_summary(ADEQUATE | {"detectable": somewhere})
    assert "such as end-cushion (damping 8.3 N·s/m, length 80 mm)" in told
    blind = [{**DIAGNOSED["detectable"][0], "size": None}]
    assert "no other effect of the catalogue is detectable" in diagnose.evidence_summary(
        ADEQUATE | {"detectable": blind}
    )


def test_an_unexplained_residual_comes_with_an_experiment() -> None:
    rest = {"verdict": "unexplained", "missing": [], "sentence": "Something is left."}
    answer = ADEQUATE | rest | {"next_experiment": "Hold the piston."}  # what refused effects move is no finding
    assert one_line(messages.render("diagnose", answer, "p.toml")) == "found Something is left. do Hold the piston."


def model(*effects: str, test: float, current: bool = False, data: str = "here") -> dict[str, Any]:
    parameters = {f"{name}.area": LEAK["area"] for name in effects}
    model = {"effects": list(effects), "parameters": parameters, "when": "2026-11-22T10:00:00Z"}
    return {**model, "error": {"train": 1.0, "test": test}, "data": data, "current": current}


MODELS = [model(test=18.1), model("piston-leak", test=0.834, current=True)]


def test_the_history_says_the_fall_and_draws_it() -> None:
    fall, _, first, last = history.lines(MODELS, "p.toml")
    assert fall == "error    18.1 → 0.83 × noise on test recordings with piston-leak"
    assert first.split()[-1] == "#" * history.BAR_LENGTH
    assert last.split()[-1] == "now"
    assert history.error_bar(18.1**0.5, 18.1) == "#" * (history.BAR_LENGTH // 2)  # a logarithmic scale


def test_models_on_other_data_are_never_on_one_line() -> None:
    other = model("stribeck", test=99.0, data="elsewhere")
    assert history.error_reduction(history.models_on_current_data([other, *MODELS])) == history.error_reduction(MODELS)
    told = "\n".join(history.lines([other, *MODELS], "p.toml"))
    assert told.index("not to be compared") < told.index("99.0")


def test_a_removed_effect_is_stated() -> None:
    assert history.effect_changes(MODELS[1], model("stribeck", test=2.0)) == "stribeck without piston-leak"


def test_run_states_an_effect_that_was_added() -> None:
    answers = {"diagnose": ADEQUATE | {"sentence": "Nothing is missing."}, "report": {"checks": [{}, {}]}}
    assert list(summary.lines(answers, MODELS, [], "report.html", "p.toml")) == [
        "error    18.1 → 0.83 × noise on test recordings with piston-leak",
        "added    piston-leak: area = 0.100 ± 0.010 mm²",
        "found    Nothing is missing.",
        "checks   2 passed",
        "report   report.html",
    ]


def test_run_states_the_verdict_what_to_do_and_failed_checks() -> None:
    lines = list(summary.lines({"diagnose": DIAGNOSED}, MODELS[:1], ["a = 3 (max 1): FAILED"], "report.html", "p.toml"))
    told = one_line("\n".join(lines))
    assert "found The model lacks piston-leak (leak across the piston): with it the error falls. do" in told
    assert "do pneucli add p.toml --suggested checks a = 3 (max 1): FAILED" in told


LOOP = {
    "tolerance_um": 10.0,
    "closed_loop": {
        "steps": {"steady_um": 4.0, "cycle_um": 0.0},
        "sine": {"steady_um": None, "tracking_rms_um": 55.3},
        "load": {"steady_um": 3.0, "peak_um": 6000.0, "recovery_s": 0.26},
    },
    "robust": {
        "checks": {"steady_um": {"held": 6, "runs": 8, "limit": 10.0}},
        "by_effect": [
            {"check": "steady_um", "effect": "all", "held": 6, "runs": 8},
            {"check": "steady_um", "effect": "valve-lag", "held": 1, "runs": 2},
            {"check": "steady_um", "effect": "presliding", "held": 0, "runs": 2},
            {"check": "steady_um", "effect": "stribeck", "held": 2, "runs": 2},
        ],
    },
}


def test_a_controller_states_its_worst_figures() -> None:
    said = "4.0 µm at rest (tolerance 10 µm), 55 µm rms on the way (sine), a load is rejected to 50 µm in 0.26 s"
    assert simulate.performance_line(LOOP) == said
    assert simulate.failed_scenarios(LOOP) == []
    assert simulate.harmful_effects(LOOP) == ["presliding", "valve-lag"]


@pytest.mark.parametrize(
    "broken", [{"steady_um": 11.0}, {"steady_um": 1.0, "cycle_um": 12.0}, {"peak_um": 6000.0, "recovery_s": None}]
)
def test_a_scenario_fails_that_misses_the_tolerance_or_never_recovers(broken: dict[str, float | None]) -> None:
    assert simulate.failed_scenarios({**LOOP, "closed_loop": {"load": broken}}) == ["load"]


@pytest.mark.parametrize(("signal", "told"), [("", "driven_1"), ("p1", "driven_1, p1")])
def test_a_repair_of_a_whole_file_names_no_signal(signal: str, told: str) -> None:
    assert ingest.repair_location({"recording": "driven_1", "signal": signal}) == told
