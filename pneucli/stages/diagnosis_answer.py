"""Parts of the answer of ``diagnose``: numbers, and the sentences that messages make of them."""

from collections.abc import Iterable, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from pneucli.compare.error_regions import locator_signals
from pneucli.diagnose.adequacy import bins_of
from pneucli.diagnose.data import DiagnosisData
from pneucli.diagnose.diagnosis import Diagnosis, MinimumDetectableEffect
from pneucli.diagnose.discrepancy import UnexplainedResidual
from pneucli.diagnose.evidence import VisitedSet
from pneucli.diagnose.score import FittedModel
from pneucli.figure import FIGURE_COLUMNS, Figure
from pneucli.identify.estimation.parameters import null_value
from pneucli.identify.residuals import ResidualModel
from pneucli.io.artifacts import Tables
from pneucli.messages.diagnose import (
    MIN_TOLD_PROBABILITY,
    PERIODIC_SHAPE,
    SHAPES,
    Answer,
    DetectionLimit,
    FittedSet,
    Place,
    Shift,
    Unexplained,
    detection_limit_sentence,
    discrepancy_kind_text,
    location_phrase,
)
from pneucli.messages.plan import (
    detecting_experiment,
    discrepancy_experiment,
    discriminating_manoeuvre,
    distinguishing_experiment,
)
from pneucli.physics.declaration import Effect
from pneucli.plan.manoeuvres import planned_recording
from pneucli.plan.rivals import most_discriminating_manoeuvre
from pneucli.quantities import SIGNALS
from pneucli.simulate.model import Model
from pneucli.stages.answer_parts import vessel_scale
from pneucli.stages.pipeline_data import PipelineData

SHAPE_BINS = 40
SHAPE_FILE = "shape.parquet"
MAX_SETS = 10  # of effects that were fitted together
MAX_SHAPE_RECORDINGS = 3  # recordings a picture is drawn of
NOT_FITTED = {"": Figure(np.nan, np.nan, np.nan)}


def unexplained_answer(one: UnexplainedResidual) -> Unexplained:
    """Return the entry about the unexplained residual."""
    character = discrepancy_kind_text(one.kind, one.acts_as, one.variable, share=one.share, period=one.period)
    law = PERIODIC_SHAPE if one.kind == "periodic" else SHAPES.get(one.simple_shape or "")
    of = (one.subsystem, one.channel, one.ratio, one.variable)
    return Unexplained(*of, character, law, one.share, one.other_signals)


def detection_limits(found: Diagnosis, study: PipelineData) -> list[DetectionLimit]:
    """Return the entries about the detection limits of the effects that the last model lacks."""
    fitted = {d.effect.name: d.candidate.full.model for d in found.decisions if d.candidate}
    return [detection_limit(one, study, found.missing, fitted.get(one.effect.name)) for one in found.detectable]


def detection_limit(
    one: MinimumDetectableEffect, study: PipelineData, missing: Sequence[str] = (), fitted: Model | None = None
) -> DetectionLimit:
    """Return the entry about the detection limit of an effect beside the ``missing`` ones.

    ``fitted`` is the model in which the effect was fitted in the search: what showed there is not called undetectable,
    but for what these recordings say of it beside the others.
    """
    parameter, name = one.parameter, f"{one.effect.name}.{one.parameter.name}"
    factor, unit = vessel_scale(name, parameter.unit, study)
    null = None if fitted is None else null_value(parameter, fitted)
    exceeded = fitted is not None and null is not None and abs(fitted.values[name] - null) >= one.size
    size = factor * one.size if one.plausible or exceeded else None
    places = [Place(p.name, value, p.unit) for p, value in one.where.items()]
    phrases = [location_phrase(p.title or p.name, value, p.unit) for p, value in one.where.items()]
    title = parameter.title or parameter.name
    text = detection_limit_sentence(
        one.effect.title, title, size, unit, parameter.null, phrases, missing if fitted else ()
    )
    return DetectionLimit(one.effect.name, parameter.name, size, unit, one.typical, places, text)


def fitted_sets(found: Diagnosis) -> list[FittedSet]:
    """Return the sets of effects that leave least, of all that were fitted."""
    best = sorted((one.visited for one in found.sets), key=lambda visited: visited.cost)
    return [FittedSet(visited.effects, visited.cost) for visited in best[:MAX_SETS]]


def parameter_shift(one: Shift, study: PipelineData) -> Shift:
    """Return the shift of a base parameter, per volume of the vessel where that volume is unknown."""
    factor, unit = vessel_scale(one.parameter, one.unit, study)
    return replace(one, from_=factor * one.from_, to=factor * one.to, unit=unit)


def _discriminating_experiment(data: DiagnosisData, found: Diagnosis, name: str, other: str) -> str:
    """Return how to distinguish two effects: as declared, and the manoeuvre in which both fitted models differ most."""
    procedures = data.effects[name].separate, data.effects[other].separate
    rival = next(c.full.model for c in found.path.terms[name].rivals if c.effect.name == other)
    best = most_discriminating_manoeuvre(found.path.last.model, rival, [m.experiment for m in data.residual_models])
    simulated = (
        discriminating_manoeuvre(None)
        if best is None
        else discriminating_manoeuvre(
            planned_recording(best.manoeuvre, found.path.last.model).manoeuvre, best.channel, best.times_noise
        )
    )
    return f"{distinguishing_experiment((name, other), procedures)} {simulated}"


def proposed_experiment(data: DiagnosisData, found: Diagnosis) -> str | None:
    """Return the next experiment: for indistinguishable effects, the discrepancy, or an undetectable effect."""
    if data.implausible:
        return None
    pairs = [(n, other) for n in found.missing for other in found.equivalents[n]]
    if pairs:
        return " ".join(_discriminating_experiment(data, found, a, b) for a, b in pairs[:2])
    if (rest := found.unexplained) is not None:
        told = [j for j in found.path.refused if j.probability >= MIN_TOLD_PROBABILITY]
        effects = [j.decision.effect for j in sorted(told, key=lambda j: -j.probability)]
        return discrepancy_experiment(
            [(e.name, e.separate) for e in effects], rest.channel, rest.subsystem, rest.variable
        )
    undetectable = [d.effect for d in found.detectable if not d.plausible]
    if found.verdict in ("adequate", "inconclusive") and undetectable:
        return detecting_experiment(undetectable[0].name, undetectable[0].separate)
    return None


def write_diagnosis(pipeline: PipelineData, data: DiagnosisData, diagnosis: Diagnosis, answer: Answer) -> None:
    """Write ``candidates``, ``ladder``, ``shape``, ``law`` and ``sets`` into the folder of the stage."""
    shapes = [row for i, name in enumerate(diagnosis.path.added) for row in _residual_shapes(data, diagnosis, i, name)]
    tables = pipeline.tables("diagnose", "ingest/signals.parquet")
    _write_tables(tables, answer, shapes, list(_smooth_term_rows(diagnosis.unexplained)))
    rows = [
        (float(i), *_texts(s.visited), s.log_evidence, s.probability, s.visited.cost, channel, *sums)
        for i, s in enumerate(diagnosis.sets)
        for channel, sums in s.visited.channels.items()
    ]
    columns = (
        "number [1], effects [1], sizes [1], log_evidence [1], probability [1], cost [1], channel [1], readings [1], "
        "log_variance [1]"
    )
    tables.write("sets", columns, rows)


def _texts(visited: VisitedSet) -> tuple[str, str]:
    """Return the effects of a set and their sizes over their typical ones."""
    return ", ".join(visited.effects), ", ".join(f"{visited.sizes[name]:.4g}" for name in visited.effects)


def write_flow_diagnosis(pipeline: PipelineData, answer: Answer) -> None:
    """Write the same files for a steady bench, whose residuals have no shapes over time."""
    _write_tables(pipeline.tables("diagnose", "ingest/signals.parquet"), answer, [], [])


def _write_tables(tables: Tables, answer: Answer, shapes: list[tuple[Any, ...]], laws: list[tuple[Any, ...]]) -> None:
    candidates = [
        (
            *(c.effect, c.error_before, c.error_after, name, p.value, p.unit),
            *(end if np.isfinite(end) else None for end in (p.low, p.high)),
            *(c.supported, c.effect in answer.missing, ", ".join(c.indistinguishable_from), c.reason, c.why),
        )
        for c in answer.candidates
        for name, p in (c.parameters or NOT_FITTED).items()
    ]
    columns = (
        f"effect, error_before [1], error_after [1], parameter, {FIGURE_COLUMNS}, supported, missing, "
        "indistinguishable_from, reason, why"
    )
    tables.write("candidates", columns, candidates)
    ladder = [(s.add or "", s.error_train, s.error_test) for s in answer.ladder]
    tables.write("ladder", "add, error_train [1], error_test [1]", ladder)
    columns = (
        "effect, recording, channel, variable, unit, value [SI], residual_before [see column unit], "
        "residual_after [see column unit], expected [see column unit]"
    )
    tables.write("shape", columns, shapes)
    tables.write("law", "channel, acts_as, variable, unit, value [SI], law [see column unit]", laws)


def _smooth_term_rows(residual: UnexplainedResidual | None) -> Iterable[tuple[Any, ...]]:
    """Yield the smooth function of the unexplained residual over its signal."""
    smooth_term = None if residual is None else residual.smooth_term
    if residual is not None and smooth_term is not None:
        for position, value in zip(
            np.linspace(smooth_term.low, smooth_term.high, smooth_term.values.size), smooth_term.values, strict=True
        ):
            yield (
                residual.channel,
                smooth_term.acts_as,
                smooth_term.signal,
                smooth_term.unit,
                float(position),
                float(value),
            )


def _residual_shapes(data: DiagnosisData, diagnosis: Diagnosis, i: int, name: str) -> Iterable[tuple[Any, ...]]:
    """Yield the residual before and after an effect, and the change, over the variable in which the effect shows."""
    before, after = diagnosis.path.models[i], diagnosis.path.models[i + 1]
    effect = data.effects[name]
    reductions = []
    for residual_model in [*data.held_out, *data.train]:
        if residual_model.is_sensitive_to(effect):
            reductions += [
                _residual_reduction(residual_model, channel, effect, before, after)
                for channel in residual_model.channels
            ]
    finite = [f for f in reductions if f is not None]
    for _, rows in sorted(finite, key=lambda f: -f[0])[:MAX_SHAPE_RECORDINGS]:
        yield from rows


def _residual_reduction(
    residual_model: ResidualModel, channel: str, effect: Effect, before: FittedModel, after: FittedModel
) -> tuple[float, list[tuple[Any, ...]]] | None:
    old, new = residual_model.residual(before.model)[channel], residual_model.residual(after.model)[channel]
    variables = locator_signals(residual_model.experiment)
    variable = effect.shows_over if effect.shows_over in variables else "time"
    q = variables[variable]
    valid = np.isfinite(q) & ((old != 0.0) | (new != 0.0))
    if np.count_nonzero(valid) < SHAPE_BINS:
        return None
    q, old, new = q[valid], old[valid], new[valid]
    position = bins_of(q, SHAPE_BINS)
    count = np.maximum(np.bincount(position), 1)
    mean = [np.bincount(position, part) / count for part in (q, old, new, old - new)]
    keys = (effect.name, residual_model.experiment.recording.name, channel, variable, SIGNALS[channel].unit)
    reduction = float(np.sum(old**2) - np.sum(new**2)) / residual_model.noise[channel] ** 2
    return reduction, [(*keys, *(float(part[b]) for part in mean)) for b in range(count.size)]
