"""The identified model in memory: its curves and errors with values and effects that differ from the fitted ones."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pneucli.compare import Comparison, compare, overall_error
from pneucli.compare.error_regions import locator_signals
from pneucli.errors import InputError, did_you_mean
from pneucli.identify.estimation.parameters import FreeParameter, base_parameters, effect_parameters
from pneucli.messages.formatting import format_noise_ratio, format_quantity
from pneucli.physics.declaration import Effect
from pneucli.physics.effects import select_effects
from pneucli.quantities import SIGNALS
from pneucli.report.page_elements import Panel
from pneucli.report.report_data import Table
from pneucli.report.sections.comparison import channel_panel, command_panels, deviation_panels
from pneucli.simulate.experiment import Experiment
from pneucli.simulate.model import Model, has_parameter, parameter_value, with_effect, with_parameters
from pneucli.simulate.rig_quantities import rig_quantities
from pneucli.stages.model_file import load_model
from pneucli.stages.pipeline_data import PipelineData
from pneucli.workbench.one_step import gauss_newton_step

Array = NDArray[np.float64]
MAX_SPANS = 200  # shaded stretches of time of one channel


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
        artifacts: The folder of the artifacts.
        answers: The answers of ``compare`` and, where there is one, ``diagnose``.
        former: The model before; its recordings are kept where they are the same.

    """

    def __init__(
        self,
        data: PipelineData,
        artifacts: Path,
        answers: Mapping[str, Mapping[str, Any]],
        former: LiveModel | None = None,
    ) -> None:
        self.model = load_model(artifacts / "identify", data.rig, data.effects)
        self.rotary = data.context.config.rotary
        self._prepared_from = data.data_digest, replace(data.rig, priors={})
        self.experiments: dict[str, Experiment]
        if former is not None and former._prepared_from == self._prepared_from:
            self.experiments = former.experiments
        else:
            self.experiments = {e.recording.name: e for e in data.experiments}
        self.available_effects = data.available_effects
        compared = answers["compare"]
        self.where: Sequence[Mapping[str, Any]] = compared["where"]
        self._noise: dict[str, dict[str, float]] = {}
        self._fitted: tuple[tuple[str, bool] | None, Mapping[str, Table]] = (None, {})
        for one in compared["channels"]:
            self._noise.setdefault(one["recording"], {})[one["channel"]] = one["noise"]
        self._suggested = _suggested_values(answers.get("diagnose", {}))
        self._moved = _moved_values(answers.get("diagnose", {}))

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
        if name not in self.experiments:
            raise InputError(
                "the workbench", f'no recording "{name}"', mend=did_you_mean(name, self.experiments), code="E091"
            )
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
        if wanted.step:
            experiment = self.experiment(recording)
            free = [p for p in self._free_parameters(model, [experiment]) if p.name not in values]
            model = gauss_newton_step(model, experiment, free, self._noise.get(recording, {}))
        return model

    def _start_of(self, effect: Effect, model: Model) -> dict[str, float]:
        """Return start values of an effect's parameters: what the diagnosis found, else the smallest usual size."""
        quantities = rig_quantities(model, list(self.experiments.values()))
        names = {f"{effect.name}.{p.name}" for p in effect.main_parameters}
        suggested = {n: v for n, v in self._suggested.items() if n in names and math.isfinite(v)}
        return {p.name: p.start for p in effect_parameters(effect, model, quantities, suggested) if p.name in names}

    def comparison(self, model: Model, recording: str, *, free_run: bool = False) -> Comparison:
        """Return the comparison of a model with one recording, as the command ``compare`` makes it."""
        experiment = self.experiment(recording)
        experiment = experiment.with_restarts(None) if free_run else experiment
        noise = self._noise.get(recording, {})
        return compare(model, experiment, {c: noise.get(c, math.nan) for c in experiment.channels})

    def _fitted_tables(self, recording: str, free_run: bool) -> Mapping[str, Table]:
        """Return the columns of the identified model; those of the last recording are kept while the hand moves."""
        if self._fitted[0] != (recording, free_run):
            tables = comparison_tables(self.comparison(self.model, recording, free_run=free_run))
            self._fitted = (recording, free_run), tables
        return self._fitted[1]

    def overall_error(self, wanted: Variant, recording: str) -> dict[str, float | None]:
        """Return the error over all recordings by use, x noise, as ``compare`` has it under ``error``."""
        model = self.variant(wanted, recording)
        results = [r for name in self.experiments for r in self.comparison(model, name).results]
        return {use: overall_error(results, use) for use in ("train", "test")}

    def curves(
        self,
        wanted: Variant,
        recording: str,
        interval: tuple[float, float] | None,
        max_samples: int,
        earlier: Mapping[str, Table] | None = None,
    ) -> tuple[list[Panel], dict[str, Any]]:
        """Return the panels of a recording within an interval of time, and what the page says of them.

        ``earlier`` are the columns of an earlier model by channel, drawn as the model before; by default it is the
        identified one.
        """
        model = self.variant(wanted, recording)
        found = self.comparison(model, recording, free_run=wanted.free_run)
        changed = wanted.values or wanted.effects is not None or wanted.step
        name = "fitted" if earlier is None else "earlier"
        if earlier is None and changed:
            earlier = self._fitted_tables(recording, wanted.free_run)
        tables = comparison_tables(found)
        panels = recording_panels(
            recording,
            tables,
            earlier or {},
            command_table(found.experiment),
            self._noise.get(recording, {}),
            interval,
            max_samples,
        )
        panels = [_with_names(panel, {"before": name, "after": "now"}) for panel in panels]
        time = found.experiment.time
        return panels, {
            "ends": [float(time[0]), float(time[-1])],
            "spans": self._spans(found.experiment),
            "errors": [error_answer(r) for r in found.results],
            "values": {p.name: parameter_value(model, p.name) for p in self._free_parameters(model, [found.experiment])}
            if wanted.step or wanted.effects is not None
            else {},
        }

    def _spans(self, experiment: Experiment) -> dict[str, list[tuple[float, float]]]:
        """Return the stretches of time in which the identified model fails, by channel, as ``compare`` locates them."""
        signals = locator_signals(experiment)
        spans: dict[str, list[tuple[float, float]]] = {}
        for one in self.where:
            if one["recording"] == experiment.recording.name and one["signal"] in signals:
                values = signals[one["signal"]]
                inside = (values >= one["from"]) & (values <= one["to"])
                spans.setdefault(one["channel"], []).extend(_stretches(experiment.time, inside))
        return {channel: _merged(found)[:MAX_SPANS] for channel, found in spans.items()}


def _with_names(panel: Panel, names: Mapping[str, str]) -> Panel:
    """Return a panel whose curves have other names; what follows a comma in a label stays."""
    series = []
    for one in panel.series:
        first, comma, rest = one.label.partition(",")
        series.append(replace(one, label=f"{names.get(first, first)}{comma}{rest}"))
    return replace(panel, series=series)


def _suggested_values(diagnosis: Mapping[str, Any]) -> dict[str, float]:
    """Return the values that the diagnosis found for each tested effect, by EFFECT.PARAMETER."""
    candidates = diagnosis.get("candidates", [])
    return {f"{c['effect']}.{name}": p["value"] for c in candidates for name, p in (c["parameters"] or {}).items()}


def _moved_values(diagnosis: Mapping[str, Any]) -> tuple[frozenset[str], dict[str, float]]:
    """Return the effects of the model with all that the diagnosis names, and the values of what moves with them."""
    moved = {one["parameter"]: one["to"] for one in diagnosis.get("moved") or []}
    return frozenset([*diagnosis.get("model", {}).get("effects", []), *diagnosis.get("missing", [])]), moved


def _stretches(time: Array, inside: NDArray[np.bool_]) -> list[tuple[float, float]]:
    """Return begin and end in s of each run of true samples."""
    edges = np.flatnonzero(np.diff(np.concatenate([[False], inside, [False]]).astype(np.int8)))
    return [(float(time[a]), float(time[b - 1])) for a, b in zip(edges[::2], edges[1::2], strict=True)]


def _merged(spans: Sequence[tuple[float, float]]) -> list[tuple[float, float]]:
    """Return stretches that do not overlap and hold the same times.

    >>> _merged([(3.0, 4.0), (0.0, 1.0), (0.5, 2.0)])
    [(0.0, 2.0), (3.0, 4.0)]
    """
    found: list[tuple[float, float]] = []
    for begin, end in sorted(spans):
        if found and begin <= found[-1][1]:
            found[-1] = found[-1][0], max(end, found[-1][1])
        else:
            found.append((begin, end))
    return found


def comparison_tables(found: Comparison) -> dict[str, Table]:
    """Return the columns of ``compare/residuals.parquet`` by channel, from a comparison in memory."""
    segment = found.experiment.segments.astype(np.float64)
    return {
        r.channel: Table(
            {
                "time": found.experiment.time,
                "unit": np.array([SIGNALS[r.channel].unit]),
                "measured": found.measured[r.channel],
                "model": found.modelled[r.channel],
                "residual": found.residual(r.channel),
                "segment": segment,
            }
        )
        for r in found.results
    }


def command_table(experiment: Experiment) -> Table:
    """Return the valve's commands over time."""
    commands = {name: experiment.raw[name] for name in ("u", "u2") if name in experiment.raw}
    return Table({"time": experiment.time, **commands})


def recording_panels(
    recording: str,
    tables: Mapping[str, Table],
    before: Mapping[str, Table],
    commands: Table,
    noise: Mapping[str, float],
    interval: tuple[float, float] | None,
    max_samples: int,
) -> list[Panel]:
    """Return the panels of one recording as the report has them, within an interval of time."""
    tables, before = ({c: _within(t, interval) for c, t in some.items()} for some in (tables, before))
    panels = command_panels(_within(commands, interval), max_samples)
    panels += [channel_panel(c, t, before.get(c), max_samples) for c, t in tables.items()]
    by_key = {(recording, c): t for c, t in tables.items()}
    return panels + deviation_panels(recording, by_key, {(recording, c): n for c, n in noise.items()}, max_samples)


def _within(table: Table, interval: tuple[float, float] | None) -> Table:
    """Return the rows within an interval, and one more on each side, so that curves go on to the edge."""
    if interval is None:
        return table
    time = table["time"]
    first, last = np.searchsorted(time, interval)
    rows = slice(max(int(first) - 1, 0), max(int(last) + 1, 2))
    return Table({n: v if n == "unit" else np.asarray(v)[rows] for n, v in table.columns.items()}, table.units)


def error_answer(result: Any) -> dict[str, Any]:
    """Return one channel's error x noise and in the unit that people read, as the page shows it."""
    return {
        "channel": result.channel,
        "ratio": None if math.isnan(result.ratio_to_noise) else result.ratio_to_noise,
        "text": f"{format_noise_ratio(_finite(result.ratio_to_noise))} × noise",
        "size": format_quantity(result.rmsd, result.unit, 3),
    }


def _finite(value: float) -> float | None:
    return value if math.isfinite(value) else None
