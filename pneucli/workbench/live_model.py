"""The identified model in memory: its curves and errors with values and effects that differ from the fitted ones."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property, partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pneucli.arrays import Array
from pneucli.compare import ChannelResult, Comparison
from pneucli.compare import compare as compare_with
from pneucli.compare.error_regions import locator_signals
from pneucli.diagnose.data import DiagnosisData
from pneucli.errors import InputError, require_known
from pneucli.identify.estimation.parameters import FreeParameter, base_parameters, effect_parameters
from pneucli.identify.residuals import residual_models
from pneucli.messages import answer_of, compare, diagnose
from pneucli.messages.formatting import format_fit, format_noise_ratio, format_quantity
from pneucli.physics.declaration import Effect
from pneucli.physics.effects import select_effects
from pneucli.report.page_elements import Panel
from pneucli.report.report_data import Table
from pneucli.report.sections.comparison import channel_panel, command_panels, deviation_panels
from pneucli.simulate.experiment import Experiment
from pneucli.simulate.model import Model, has_parameter, parameter_value, with_effect, with_parameters
from pneucli.simulate.outputs import simulate_outputs
from pneucli.simulate.rig_quantities import rig_quantities
from pneucli.stages.pipeline_data import PipelineData
from pneucli.workbench.prediction import (
    Interval,
    Line,
    Place,
    Prediction,
    Simulated,
    at_rows,
    comparison_tables,
    joined,
    lay_out,
    visible,
    within,
)

MAX_RESIDUALS = 20_000  # of the step: it is to be seen at once, and more samples hardly change it
RANK_TOLERANCE = 1e-3  # of the largest singular value, below which a direction is not moved
STEPS = (1.0, 0.5, 0.25, 0.1, 0.03)  # shares of the step, until one lowers the cost
MAX_SPANS = 200  # shaded stretches of time of one channel
MIN_SAMPLES = 100  # of the curve of a recording among others
MAX_SIMULATION = 0.06  # s of a simulation that still follows the hand; longer ones are predicted while it moves


@dataclass(frozen=True)
class Variant:
    """How a model differs from the identified one.

    Attributes:
        values: Values of parameters by name, SI or the catalogue's unit.
        effects: All effects of the model; None: those of the identified one.
        free_run: Whether the model runs from the first sample on, without restarts.
        step: Whether one Gauss-Newton step on the shown recording replaces the start values of added effects.

    """

    values: Mapping[str, float]
    effects: tuple[str, ...] | None = None
    free_run: bool = False
    step: bool = False


class LiveModel:
    """The identified model and its recordings.

    Args:
        data: The pipeline's rig, recordings and effects.
        answers: The answers of ``compare`` and, where there is one, ``diagnose``.
        former: The model before; its recordings are kept where they are the same.

    """

    def __init__(
        self,
        data: PipelineData,
        answers: Mapping[str, Mapping[str, Any]],
        former: LiveModel | None = None,
    ) -> None:
        self.model = data.identified_model
        self.rotary = data.context.config.rotary
        self._prepared_from = data.data_digest, replace(data.rig, priors={})
        self.experiments: dict[str, Experiment]
        if former is not None and former._prepared_from == self._prepared_from:
            self.experiments = former.experiments
        else:
            self.experiments = {e.recording.name: e for e in data.experiments}
        self.available_effects = self._that_can_show(data.available_effects)
        compared, diagnosis = answer_of(compare.Answer, answers), answer_of(diagnose.Answer, answers)
        self.where = compared.where
        self._noise: dict[str, dict[str, float]] = {}
        self.places = lay_out(self.experiments.values())
        self._free_runs: dict[str, Experiment] = {}
        self._fitted: dict[tuple[str, bool], Mapping[str, Table]] = {}
        self._prediction = Prediction()
        self._last_step: tuple[object, Model] | None = None
        self._located: dict[str, dict[str, list[Interval]]] = {}
        for one in compared.channels:
            self._noise.setdefault(one.recording, {})[one.channel] = one.noise
        self._suggested = {f"{c.effect}.{n}": p.value for c in diagnosis.candidates for n, p in c.parameters.items()}
        # the effects of the model with all that the diagnosis names, and the values of what moves with them
        self._moved = {*diagnosis.model.effects, *diagnosis.missing}, {one.parameter: one.to for one in diagnosis.moved}

    def _that_can_show(self, effects: Mapping[str, Effect]) -> dict[str, Effect]:
        """Return the effects of the model, and those with which a fit to the training recordings can do something."""
        train = residual_models([e for e in self.experiments.values() if e.recording.use == "train"])
        data = DiagnosisData(train, [], effects, modelled_parts=self.model.excluded_parts)
        return {name: e for name, e in effects.items() if e in self.model.effects or data.is_observable(e)}

    @cached_property
    def free(self) -> dict[str, FreeParameter]:
        """The parameters that a fit to all recordings would find, with their bounds, by name."""
        return {p.name: p for p in self._free_parameters(self.model, list(self.experiments.values()))}

    def _free_parameters(self, model: Model, experiments: Sequence[Experiment]) -> list[FreeParameter]:
        quantities = rig_quantities(model, experiments)
        own = [p for e in model.effects for p in effect_parameters(e, model, quantities)]
        return [*base_parameters(model, experiments), *own]

    def experiment(self, name: str) -> Experiment:
        """Return a recording made ready; InputError where there is none of that name over time."""
        require_known([name], self.experiments, "the workbench", 'no recording "{}"', code="E091")
        return self.experiments[name]

    def variant(self, wanted: Variant, recording: str) -> Model:
        """Return the model of a variant; effects that it adds start from the diagnosis or from their usual size."""
        model, effects = self.model, self.model.effects
        if wanted.effects is not None:
            effects = select_effects(list(wanted.effects), self.available_effects)
        model = replace(model, effects=tuple(e for e in effects if e in model.effects))
        added = [e for e in effects if e not in model.effects]
        for effect in added:
            model = with_effect(model, effect, self._start_of(effect, model))
        if added and self._moved[0] == {e.name for e in effects}:
            model = with_parameters(model, {n: v for n, v in self._moved[1].items() if has_parameter(model, n)})
        values = dict(wanted.values)
        for name in values:
            if not has_parameter(model, name):
                raise InputError("the workbench", f'"{name}" is no parameter of this model', code="E091")
        model = with_parameters(model, values) if values else model
        return self._stepped(wanted, model, recording) if wanted.step else model

    def _stepped(self, wanted: Variant, model: Model, recording: str) -> Model:
        """Return the model after one step on a recording; the last one is kept, as all recordings ask for it."""
        key = wanted.effects, dict(wanted.values), recording
        kept = self._last_step
        if kept is None or kept[0] != key:
            experiment = self.experiment(recording)
            free = [p for p in self._free_parameters(model, [experiment]) if p.name not in wanted.values]
            kept = self._last_step = key, gauss_newton_step(model, experiment, free, self._noise.get(recording, {}))
        return kept[1]

    def _start_of(self, effect: Effect, model: Model) -> dict[str, float]:
        """Return start values of an effect's parameters: what the diagnosis found, else the smallest usual size."""
        quantities = rig_quantities(model, list(self.experiments.values()))
        names = {f"{effect.name}.{p.name}" for p in effect.main_parameters}
        suggested = {n: v for n, v in self._suggested.items() if n in names and math.isfinite(v)}
        return {p.name: p.start for p in effect_parameters(effect, model, quantities, suggested) if p.name in names}

    def comparison(self, model: Model, recording: str, *, free_run: bool = False) -> Comparison:
        """Return the comparison of a model with one recording, as the command ``compare`` makes it."""
        experiment = self.experiment(recording)
        if free_run:
            if recording not in self._free_runs:
                self._free_runs[recording] = experiment.with_restarts(None)
            experiment = self._free_runs[recording]
        noise = self._noise.get(recording, {})
        return compare_with(model, experiment, {c: noise.get(c, math.nan) for c in experiment.channels})

    def _fitted_tables(self, recording: str, free_run: bool) -> Mapping[str, Table]:
        """Return the curves of the identified model, kept while the hand moves."""
        if (recording, free_run) not in self._fitted:
            tables = comparison_tables(self.comparison(self.model, recording, free_run=free_run))
            kept = {c: Table({"time": t["time"], "model": t["model"]}) for c, t in tables.items()}
            self._fitted[recording, free_run] = kept
        return self._fitted[recording, free_run]

    def errors(self, wanted: Variant, focus: str, recording: str) -> tuple[ChannelResult, ...]:
        """Return the errors of one recording, as ``compare`` has them."""
        kept = self._prediction.same(_others(wanted, focus), wanted.values, (recording,))
        found = kept.found[recording] if kept else self.comparison(self.variant(wanted, focus), recording)
        return found.results

    def simulated(self, wanted: Variant, focus: str, recordings: Sequence[str]) -> Simulated:
        """Return the comparisons of recordings with a model; those of the last models are kept."""
        others = _others(wanted, focus)
        kept = self._prediction.same(others, wanted.values, recordings)
        if kept is None:
            begin = time.perf_counter()
            model = self.variant(wanted, focus)
            found = {name: self.comparison(model, name, free_run=wanted.free_run) for name in recordings}
            kept = Simulated(others, dict(wanted.values), found, time.perf_counter() - begin)
            self._prediction.keep(kept)
        return kept

    def _source(self, wanted: Variant, focus: str, recordings: Sequence[str], moving: str | None) -> Simulated | Line:
        """Return the simulation of a model; where one takes long and the hand moves, the line that predicts it."""
        others = _others(wanted, focus)
        if moving is None or moving not in wanted.values or self._prediction.same(others, wanted.values, recordings):
            return self.simulated(wanted, focus, recordings)
        here = has_parameter(self.model, moving)
        fitted = parameter_value(self.model, moving) if here else math.nan  # of an added effect: none is fitted
        line = self._prediction.line(others, wanted.values, moving, fitted, recordings)
        slow = line is not None and line.first.seconds > MAX_SIMULATION
        return line if line and slow else self.simulated(wanted, focus, recordings)

    def curves(
        self,
        wanted: Variant,
        focus: str,
        interval: Interval | None,
        max_samples: int,
        earlier: tuple[int, Callable[[str], Mapping[str, Table]]] | None = None,
        moving: str | None = None,
    ) -> tuple[list[Panel], dict[str, Any]]:
        """Return the panels of all recordings within an interval of the common axis, and what the page says of them.

        Args:
            wanted: The model.
            focus: The recording on which a Gauss-Newton step is made.
            interval: Begin and end in s of the common axis; None: everything.
            max_samples: About how many samples of each curve.
            earlier: The number of an earlier model and its curves by recording, drawn as the model before; by default
                the identified one.
            moving: The parameter under the hand: where a simulation takes long, its curves are predicted.

        """
        name, before = ("fitted", None) if earlier is None else (f"model {earlier[0]}", earlier[1])
        if before is None and (wanted.values or wanted.effects is not None or wanted.step):
            before = partial(self._fitted_tables, free_run=wanted.free_run)
        shown = visible(self.places, interval)
        span = sum(end - begin for begin, end in shown.values())
        model, source = self.variant(wanted, focus), self._source(wanted, focus, tuple(shown), moving)
        parts: list[tuple[Place, list[Panel]]] = []
        spans: dict[str, list[Interval]] = {}
        errors = []
        for recording, own in shown.items():
            place, samples = self.places[recording], max(int(max_samples * (own[1] - own[0]) / span), MIN_SAMPLES)
            panels, results = self._drawn(source, recording, before(recording) if before else {}, own, samples)
            parts.append((place, [_named(panel, name) for panel in panels]))
            errors += [error_answer(r) for r in results]
            for channel, some in self._spans(self.experiment(recording)).items():
                spans.setdefault(channel, []).extend((a + place.shift, b + place.shift) for a, b in some)
        moves = wanted.step or wanted.effects is not None
        free = self._free_parameters(model, [self.experiment(focus)]) if moves else []
        return joined(parts), {
            "spans": spans,
            "errors": errors,
            "values": {p.name: parameter_value(model, p.name) for p in free},
            "predicted": isinstance(source, Line),
        }

    def _drawn(
        self,
        source: Simulated | Line,
        recording: str,
        before: Mapping[str, Table],
        interval: Interval,
        max_samples: int,
    ) -> tuple[list[Panel], tuple[ChannelResult, ...]]:
        """Return the panels of one recording within an interval of its own time, and its errors."""
        older = {channel: within(table, interval) for channel, table in before.items()}
        experiment = self.experiment(recording)
        if isinstance(source, Line):
            tables, results, rows = self._prediction.tables(source, recording, interval, max_samples)
            older = {channel: at_rows(table, rows) for channel, table in older.items() if rows[-1] < len(table)}
        else:
            found = source.found[recording]
            experiment, results = found.experiment, found.results
            tables = {channel: within(table, interval) for channel, table in comparison_tables(found).items()}
        return self._panels(experiment, tables, older, interval, max_samples), results

    def _panels(
        self,
        experiment: Experiment,
        tables: Mapping[str, Table],
        before: Mapping[str, Table],
        interval: Interval,
        max_samples: int,
    ) -> list[Panel]:
        """Return the panels of one recording as the report has them, within an interval of its own time."""
        noise = self._noise.get(experiment.recording.name, {})
        panels = command_panels(within(command_table(experiment), interval), max_samples)
        panels += [channel_panel(c, table, before.get(c), max_samples) for c, table in tables.items()]
        by_key = {("", channel): table for channel, table in tables.items()}
        return panels + deviation_panels("", by_key, {("", c): n for c, n in noise.items()}, max_samples)

    def _spans(self, experiment: Experiment) -> dict[str, list[Interval]]:
        """Return the stretches of time in which the identified model fails, by channel, as ``compare`` locates them."""
        name = experiment.recording.name
        if name in self._located:
            return self._located[name]
        signals = locator_signals(experiment)
        spans: dict[str, list[Interval]] = {}
        for one in self.where:
            if one.recording == name and one.signal in signals:
                values = signals[one.signal]
                inside = (values >= one.from_) & (values <= one.to)
                spans.setdefault(one.channel, []).extend(_stretches(experiment.time, inside))
        self._located[name] = {channel: _merged(found)[:MAX_SPANS] for channel, found in spans.items()}
        return self._located[name]


def _others(wanted: Variant, focus: str) -> object:
    """Return what tells a model from the fitted one, but for the values of parameters."""
    return wanted.effects, wanted.free_run, focus if wanted.step else None


def _named(panel: Panel, before: str) -> Panel:
    """Return a panel whose curves are called the same whatever their values, so that a page need not begin anew."""
    names = {"after": "model", "before": before}
    plain = [one.label.partition(",")[0] for one in panel.series]
    named = zip(panel.series, plain, strict=True)
    return replace(panel, series=[replace(one, label=names.get(label, label)) for one, label in named])


def _stretches(time: Array, inside: NDArray[np.bool_]) -> list[Interval]:
    """Return begin and end in s of each run of true samples."""
    edges = np.flatnonzero(np.diff(np.concatenate([[False], inside, [False]]).astype(np.int8)))
    return [(float(time[a]), float(time[b - 1])) for a, b in zip(edges[::2], edges[1::2], strict=True)]


def _merged(spans: Sequence[Interval]) -> list[Interval]:
    """Return stretches that do not overlap and hold the same times.

    >>> _merged([(3.0, 4.0), (0.0, 1.0), (0.5, 2.0)])
    [(0.0, 2.0), (3.0, 4.0)]
    """
    found: list[Interval] = []
    for begin, end in sorted(spans):
        if found and begin <= found[-1][1]:
            found[-1] = found[-1][0], max(end, found[-1][1])
        else:
            found.append((begin, end))
    return found


def command_table(experiment: Experiment) -> Table:
    """Return the valve's commands over time."""
    commands = {name: experiment.raw[name] for name in ("u", "u2") if name in experiment.raw}
    return Table({"time": experiment.time, **commands})


def error_answer(result: ChannelResult) -> dict[str, Any]:
    """Return one channel's error x noise and in the unit that people read, as the page shows it."""
    fit = "" if math.isnan(result.fit_percent) else f", fit {format_fit(result.fit_percent)}"
    ratio = result.ratio_to_noise
    return {
        "recording": result.recording,
        "channel": result.channel,
        "ratio": None if math.isnan(ratio) else ratio,
        "text": f"{format_noise_ratio(ratio if math.isfinite(ratio) else None)} × noise",
        "size": f"{format_quantity(result.rmsd, result.unit, 3)}{fit}",
    }


def gauss_newton_step(
    model: Model, experiment: Experiment, free: Sequence[FreeParameter], noise: Mapping[str, float]
) -> Model:
    """Return the model after one bounded Gauss-Newton step on one recording.

    Args:
        model: The model to start from.
        experiment: The recording.
        free: The parameters that may move; their values in the model are the start.
        noise: Noise floor of the channels, SI; one without is left out.

    Returns:
        The model whose cost is lower; the same model where no share of the step lowers it.

    """
    start = np.array([p.to_coordinate(max(parameter_value(model, p.name), _smallest(p))) for p in free])

    def at(z: Array) -> Model:
        return with_parameters(model, {p.name: _bounded(p, c) for p, c in zip(free, z, strict=True)})

    def residual(one: Model) -> Array:
        return _residual(one, experiment, noise)

    first = residual(at(start))
    if not free or not first.size:
        return model
    columns = []
    for i, parameter in enumerate(free):
        moved = start.copy()
        moved[i] += _difference_step(parameter, start[i])
        columns.append((residual(at(moved)) - first) / (moved[i] - start[i]))
    step = _solve(np.array(columns).T, -first)
    cost = float(first @ first)
    for share in STEPS:
        stepped = at(start + share * step)
        if float(np.sum(residual(stepped) ** 2)) < cost:
            return stepped
    return model


def _smallest(parameter: FreeParameter) -> float:
    return np.finfo(float).tiny if parameter.logarithmic else -np.inf


def _bounded(parameter: FreeParameter, z: float) -> float:
    return float(np.clip(parameter.from_coordinate(z), parameter.lower, parameter.upper))


def _difference_step(parameter: FreeParameter, z: float) -> float:
    """Return a step of the difference that stays within the bounds."""
    inside = parameter.from_coordinate(z + parameter.step) <= parameter.upper
    return parameter.step if inside else -parameter.step


def _residual(model: Model, experiment: Experiment, noise: Mapping[str, float]) -> Array:
    """Return measured minus model in units of the noise, of every so many samples; 0 where nothing was measured."""
    modelled = simulate_outputs(model, experiment)
    known = [c for c in modelled if noise.get(c, 0.0) > 0.0]
    stride = max(1, len(known) * experiment.time.size // MAX_RESIDUALS)
    parts = [(experiment.measured(c) - modelled[c])[::stride] / noise[c] for c in known]
    return np.nan_to_num(np.concatenate(parts), posinf=0.0, neginf=0.0) if parts else np.zeros(0)


def _solve(jacobian: Array, wanted: Array) -> Array:
    """Return the least-squares step; directions that the recording hardly shows stay where they are."""
    size = np.linalg.norm(jacobian, axis=0)
    scale = np.where(size > 0.0, size, 1.0)
    return np.asarray(np.linalg.lstsq(jacobian / scale, wanted, rcond=RANK_TOLERANCE)[0] / scale)
