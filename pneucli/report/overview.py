"""Compose the first screen of the page: the result in ten seconds of reading."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Any

from pneucli.messages import compare, design, diagnose, history, run, simulate
from pneucli.messages.formatting import format_noise_ratio, format_number, format_parameters, format_percent, join_names
from pneucli.messages.ingest import implausibility_sentences
from pneucli.messages.verdict import selected_step
from pneucli.report.report_data import ReportData
from pneucli.report.worst_recording import find_worst_recording, worst_recording_figure

Answer = Mapping[str, Any]
LARGE_VERDICTS = {
    "adequate": "nothing further detected",
    "unexplained": "none of the catalogue",
    "inconclusive": "inconclusive",
}
MAX_PURPOSE = 60  # characters of what an experiment is for: one line beside the picture
MAX_STEPS = 5  # of the selection path: of more models, the first and the last ones are drawn


@dataclass(frozen=True)
class Tile:
    """One of the three results: a title, a large figure, a sentence, and whether that is good or bad."""

    title: str
    large: str
    text: str
    tone: str = ""


@dataclass(frozen=True)
class PathStep:
    """A bar of the selection path: the model, its error over noise, the bar's length (0 to 1).

    ``only_if`` marks a model that was only fitted by the diagnosis, ``present`` the one of the other chapters.
    """

    label: str
    error: str
    length: float
    only_if: bool = False
    present: bool = False


@dataclass(frozen=True)
class Overview:
    """The contents of the first screen; the picture is drawn for a desk and for a telephone."""

    line: str
    tiles: Sequence[Tile]
    pictures: Mapping[str, str]
    caption: str
    ladder: Sequence[PathStep]
    failed: str
    following: str
    checks: str
    doubt: str = ""


def overview(material: ReportData) -> Overview:
    """Return the first screen, from those answers that exist."""
    found = find_worst_recording(material)
    pictures, caption = worst_recording_figure(found) if found else ({}, "")
    return Overview(
        line=_headline(material),
        tiles=[tile for tile in (_model(material), _missing(material), _controller(material)) if tile is not None],
        pictures=pictures,
        caption=caption,
        ladder=selection_path(material),
        failed=_worst_failure(material, found.recording if found else ""),
        following=_next_command(material),
        checks=_checks(material),
        doubt=_first_doubt(material),
    )


def _headline(material: ReportData) -> str:
    """Return rig, date, model and recordings in one line."""
    compared, recordings = material.answer("compare"), material.answer("ingest").get("recordings", [])
    parts = [material.rig]
    if compared.get("when"):
        parts.append(f"compared on {compared['when'][:10]}")
    if "model" in compared:
        effects = join_names(compared["model"]["effects"])
        parts.append(f"base model{f' with {effects}' if effects else ''}")
    if recordings:
        tests = sum(r["use"] == "test" for r in recordings)
        parts.append(f"{len(recordings)} recordings, {tests} held out")
    return " · ".join(filter(None, parts))


def _comparable_models(material: ReportData) -> list[Answer]:
    """Return the models that were compared with the present data, oldest first, the present one last."""
    return history.models_on_current_data(material.history) if material.history else []


def _model(material: ReportData) -> Tile | None:
    """Return the error of the model, and that of the first one."""
    answer = material.answer("compare")
    use, error = compare.evaluation_error(answer.get("error", {}))
    if error is None:
        return None
    here = _comparable_models(material)
    first = here[0]["error"][use] if len(here) > 1 else None
    large = (
        f"{format_noise_ratio(first)} → {format_noise_ratio(error)} × noise"
        if first is not None
        else f"{format_noise_ratio(error)} × noise"
    )
    added = [name for name in here[-1]["effects"] if name not in here[0]["effects"]] if here else []
    sizes = format_parameters(run.added_parameters(here[-1], added)) if added else ""
    text = (
        f"with {join_names(added)}: {sizes}{_stated_probability(material, added)}."
        if added
        else f"{compare.verdict(answer).partition(': ')[2]}."
    )
    if use == "train":
        text += " No recording was held out: this is the error of the fitted recordings."
    elif worst := compare.worst_channel_sentence(answer):
        text += f" Worst: {worst}."
    return Tile("The model", large, _capital(text), compare.overall_rating(answer))


def _stated_probability(material: ReportData, added: Sequence[str]) -> str:
    """Return the probability that the diagnosis stated for the added effects; "" where it stated none."""
    candidates = [c for one in material.diagnoses for c in one.answer.get("candidates", [])]
    stated = {c["effect"]: c["confidence"] for c in candidates if c["effect"] in added and c.get("confidence")}
    if not stated:
        return ""
    is_single = len(stated) == 1
    each = [format_percent(p) if is_single else f"{name} {format_percent(p)}" for name, p in stated.items()]
    return f"; present with a probability of {join_names(each)}"


def _missing(material: ReportData) -> Tile | None:
    """Return the verdict of the diagnosis, and the evidence for it."""
    answer = material.answer("diagnose")
    if not answer:
        return None
    evidence = diagnose.evidence_summary(answer)
    text = f"{answer['sentence']}{f' Evidence: {evidence}.' if evidence else ''}"
    large = join_names(answer["missing"]) or LARGE_VERDICTS[answer["verdict"]]
    return Tile("Missing effect", large, text, "good" if answer["verdict"] == "adequate" else "bad")


def _controller(material: ReportData) -> Tile | None:
    """Return the accuracy of the controller on the identified model, and the scenarios in which it fails."""
    answer = material.answer("simulate")
    if "closed_loop" not in answer:
        return None
    rest, *others = simulate.worst_metrics(answer) or ["nothing measured"]
    failed = simulate.failed_scenarios(answer)
    large, _, tolerance = rest.partition(" (")
    text = f"Simulated, {join_names([tolerance.rstrip(')'), *others])}." if tolerance else "Simulated."
    if comparison := design.comparison_sentence(material.answer("design")):
        text += f" {comparison}"
    if failed:
        text += f" Fails: {join_names(failed)}."
    tone = "good"
    if harmful := simulate.harmful_effects(answer):
        tone = ""
        text += f" Not robust against {join_names(harmful)} if the design does not include it."
    return Tile("The controller", large, text, "bad" if failed else tone)


def selection_path(material: ReportData) -> list[PathStep]:
    """Return the models on this data and the one with the diagnosed effects, each with its error."""
    here = _comparable_models(material)
    if not here:
        return []
    use, _ = compare.evaluation_error(here[-1]["error"])
    shown = here if len(here) <= MAX_STEPS else [*here[: MAX_STEPS // 2], *here[MAX_STEPS // 2 - MAX_STEPS :]]
    steps = [(label, m["error"][use], False, m is here[-1]) for label, m in zip(_labels(shown), shown, strict=True)]
    answer = material.answer("diagnose")
    if answer.get("missing"):
        error = selected_step(answer)[f"error_{use}"]
        steps.append((f"+ {' + '.join(answer['missing'])}", error, True, False))
    most = max([2.0, *(error for _, error, _, _ in steps if error is not None)])
    return [PathStep(label, format_noise_ratio(error), _length(error, most), *kind) for label, error, *kind in steps]


def _labels(models: Sequence[Answer]) -> Iterator[str]:
    """Yield the effects of the first model, and those that each later model adds and removes."""
    effects = join_names(models[0]["effects"])
    yield f"base model{f' with {effects}' if effects else ''}"
    for before, after in pairwise(models):
        added = [f"+ {n}" for n in after["effects"] if n not in before["effects"]]
        removed = [f"− {n}" for n in before["effects"] if n not in after["effects"]]
        yield " ".join([*added, *removed]) or "fitted again"


def _length(error: float | None, most: float) -> float:
    """Return the length of a bar on a logarithmic scale that begins at the noise floor."""
    return 0.0 if error is None or error <= 1.0 else math.log(error) / math.log(most)


def _worst_failure(material: ReportData, pictured: str) -> str:
    """Return in one sentence where the model fails worst, preferably in the recording that is ``pictured``."""
    answer = material.first_comparison.answer if material.first_comparison else material.answer("compare")
    found = sorted(compare.grouped_regions(answer), key=lambda event: event[0]["recording"] != pictured)
    if not found:
        return compare.even_error_sentence(answer) if answer else ""
    return f"{'It failed' if material.first_comparison else 'It fails'} most in {compare.describe_event(found[0])}."


def _next_command(material: ReportData) -> str:
    """Return the next step, with its command."""
    answer = material.answer("diagnose")
    if not answer:
        return f"Next: pneucli diagnose {material.file}" if material.answer("compare") else ""
    if answer["verdict"] == "adequate" and "closed_loop" in material.answer("simulate"):
        return f"Next: pneucli export {material.file} --to c"
    if answer.get("next_experiment") and not answer["missing"] and not answer.get("impossible"):
        purpose, colon, _ = answer["next_experiment"].partition(":")
        about = (
            f"{purpose[:1].lower()}{purpose[1:]}, see" if colon and len(purpose) <= MAX_PURPOSE else "the experiment in"
        )
        return f"Next: {about} the chapter Evidence"
    following = diagnose.next_step(answer, material.file, otherwise="").partition("; or: ")[0]
    return f"Next: {following}" if following else ""


def _checks(material: ReportData) -> str:
    failed = [check.path for check in material.checks if check.failure]
    if failed:
        return f"Failed checks: {join_names(failed)}."
    return f"Checks: {format_number(float(len(material.checks)), 1)} passed." if material.checks else ""


def _first_doubt(material: ReportData) -> str:
    """Return the first implausible finding that the verdict does not state already, and the number of others."""
    stated = material.answer("diagnose").get("impossible", [])
    found = implausibility_sentences(material.answer("ingest").get("plausibility", []))
    first, *more = [*(one for one in found if one not in stated), ""]
    others = f" {len(more) - 1} more under Measurements." if len(more) > 1 else ""
    return f"Doubtful: {first}.{others}" if first else ""


def _capital(text: str) -> str:
    return text[:1].upper() + text[1:]
