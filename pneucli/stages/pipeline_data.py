"""What the stages after ingest share: the model file; recordings, effects and options as domain objects."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import chain
from pathlib import Path
from typing import Literal

import numpy as np

from pneucli.compare.goodness_of_fit import MIN_HORIZON_SAMPLES, default_horizon
from pneucli.config import join_faults, plugin_files
from pneucli.diagnose.subsample import MAX_SAMPLES, MIN_REDUCTION, subsample
from pneucli.errors import InputError, require_known
from pneucli.figure import to_json
from pneucli.identify.guesses.base_model import guess_base_model
from pneucli.identify.guesses.null_command import (
    with_common_command_range,
    with_identified_null,
    with_intersample_commands,
)
from pneucli.identify.residuals import ResidualModel, residual_models
from pneucli.io.artifacts import Provenance, Tables, read_table, sha256_of
from pneucli.io.recordings import load_recordings
from pneucli.memory import release_free_memory
from pneucli.messages import answer_of, ingest
from pneucli.messages.compare import LeftOut
from pneucli.messages.formatting import format_plain
from pneucli.messages.progress import counted
from pneucli.physics.declaration import Effect
from pneucli.physics.effects import all_effects, select_effects
from pneucli.pipeline.graph import Context
from pneucli.pipeline.manifest import digest
from pneucli.plausibility.required_inputs import RequiredInput, required_inputs, tells_valve_map, without_pressure
from pneucli.plausibility.rig_check import contradicted_parts, contradictions
from pneucli.recording import Recording, Rig
from pneucli.simulate.end_stops import with_end_stops
from pneucli.simulate.experiment import Experiment
from pneucli.simulate.model import Model, ValveForm, with_parameters
from pneucli.simulate.preparation import prepare
from pneucli.simulate.valve_forms import LinearValve, SwitchingValve, ValveArea
from pneucli.stages.pipeline_file import priors_in_model, with_started_supply

MODEL_FILE = "model.parquet"
DRAWS_FILE = "parameter_draws.parquet"


def save_model(model: Model, tables: Tables) -> None:
    """Write a model's values and its valve."""
    rows = [("value", name, np.nan, value) for name, value in model.values.items()]
    rows += [row for valve in model.valves for row in _valve_rows(valve)]
    tables.write("model", "kind, name, command [V], value [SI]", rows)


def _valve_rows(valve: ValveForm) -> list[tuple[str, str, float, float]]:
    """Return a valve's rows: kind, name, command, value; the name begins with its label."""
    name = valve.label
    if isinstance(valve, LinearValve):
        return [("gain", name, valve.max_command, valve.gain)]
    if isinstance(valve, SwitchingValve):
        return [("switching", name, valve.max_command, valve.fill), ("switching", name, -valve.max_command, valve.vent)]
    overlaps = ((1.0, valve.overlap_fill), (-1.0, valve.overlap_vent))
    rows = [("area", name, c, a) for c, a in zip(valve.commands, valve.areas, strict=True)]
    return rows + [("overlap", name, sign, value) for sign, value in overlaps]


def _valve_from_rows(rows: list[tuple[str, float, float]], label: str) -> ValveForm:
    """Return the valve whose rows (kind, command, value) these are."""
    by_kind: dict[str, list[tuple[float, float]]] = {}
    for kind, command, value in rows:
        by_kind.setdefault(kind, []).append((command, value))
    if "gain" in by_kind:
        (largest, gain), *_ = by_kind["gain"]
        return LinearValve(gain, largest, label)
    if "switching" in by_kind:
        (largest, fill), (_, vent) = by_kind["switching"]
        return SwitchingValve(fill, vent, largest, label)
    knots, overlap = by_kind.get("area", []), dict(by_kind["overlap"])
    return ValveArea(tuple(c for c, _ in knots), tuple(a for _, a in knots), overlap[1.0], overlap[-1.0], label=label)


def load_model(folder: Path, rig: Rig, effects: tuple[Effect, ...]) -> Model:
    """Return the model that ``identify`` wrote."""
    table = read_table(folder / MODEL_FILE)
    rows = [
        (str(k), str(n), float(c), float(v))
        for k, n, c, v in zip(table["kind"], table["name"], table["command"], table["value"], strict=True)
    ]
    values = {n: v for k, n, _, v in rows if k == "value"}
    valves = {
        label: [(k, c, v) for k, n, c, v in rows if k != "value" and n == label] for label in ("valve", "valve_2")
    }
    second = _valve_from_rows(valves["valve_2"], "valve_2") if valves["valve_2"] else None
    return Model(rig, effects, values, _valve_from_rows(valves["valve"], "valve"), second)


def save_drawn_parameters(drawn: Sequence[Mapping[str, float]], tables: Tables) -> None:
    """Write parameters that the recordings allow as well, a row for each draw and parameter."""
    rows = [(i, name, value) for i, values in enumerate(drawn) for name, value in values.items()]
    tables.write("parameter_draws", "draw [1], name, value [SI]", rows)


def load_drawn_models(folder: Path, model: Model) -> list[Model]:
    """Return the identified model with each of the drawn sets of parameters that ``identify`` wrote."""
    table = read_table(folder / DRAWS_FILE)
    drawn: dict[int, dict[str, float]] = {}
    for draw, name, value in zip(table["draw"], table["name"], table["value"], strict=True):
        drawn.setdefault(int(draw), {})[str(name)] = float(value)
    return [with_parameters(model, values) for values in drawn.values()]


def parameter_intervals(artifacts: Path) -> dict[str, tuple[float, float]]:
    """Return the 95 % intervals of the identified parameters."""
    table = read_table(artifacts / "identify" / "parameters.parquet")
    rows = zip(table["name"], table["ci_low"], table["ci_high"], strict=True)
    return {str(name): (float(low), float(high)) for name, low, high in rows}


LONG_RECORDING_HOURS = 1.0  # h of recordings in all: one run of the model through them takes a second and more


@dataclass(frozen=True)
class PipelineData:
    """The pipeline as the domain packages see it; at most ``max_samples`` samples, of long recordings segments."""

    context: Context
    max_samples: int | None = None

    @cached_property
    def rig(self) -> Rig:
        """The stated rig with its priors; the null command is identified where the file asks for it.

        Raises InputError where the recordings need more of it than the file says.
        """
        config = self.context.config
        rig = with_identified_null(self.recordings, with_started_supply(config.to_rig(), config))
        require_stated(required_inputs([*self.recordings, *self.flow_recordings], rig), self.context.path)
        return replace(rig, priors=priors_in_model(config, self.effects, self.available_effects))

    @property
    def recordings(self) -> list[Recording]:
        """The recordings over time, in the pipeline file's order."""
        return self._loaded[0]

    @property
    def flow_recordings(self) -> list[Recording]:
        """The recordings of steady benches, whose rows have no clock."""
        return self._loaded[1]

    @property
    def horizon(self) -> float:
        """Time in s between restarts of the model: the stated one, or as the time scales of the recordings have it."""
        return self._loaded[2]

    @cached_property
    def _loaded(self) -> tuple[list[Recording], list[Recording], float]:
        false, horizon = contradicted_parts(self.contradictions), self.context.config.compare.horizon
        loaded = [
            replace(one, signals={n: v for n, v in one.signals.items() if (one.name, n) not in false})
            for one in load_recordings(self.context.artifacts / "ingest")
        ]
        over_time, steady = (self._kept([one for one in loaded if one.kind.steady == s]) for s in (False, True))
        horizon = default_horizon(over_time) if horizon is None else horizon
        if self.max_samples is not None and over_time:
            over_time = subsample(over_time, self.max_samples, horizon)
        return over_time, steady, horizon

    @cached_property
    def ingested(self) -> ingest.Answer:
        """The answer of ``ingest``."""
        return answer_of(ingest.Answer, self.context.answers)

    @cached_property
    def contradictions(self) -> list[ingest.Implausible]:
        """The findings of ``ingest`` that leave recordings or signals out; none with ``--force``."""
        return [] if self.context.options.get("force", False) else contradictions(self.ingested.plausibility)

    def _kept(self, recordings: list[Recording]) -> list[Recording]:
        """Return the recordings that nothing contradicts; all of them where none of these would be left to fit."""
        false = contradicted_parts(self.contradictions)
        kept = [one for one in recordings if (one.name, None) not in false]
        return kept if any(one.use == "train" for one in kept) else recordings

    @property
    def impossible(self) -> list[ingest.Implausible]:
        """The contradictions in recordings that are used because no others are left."""
        used = {(one.name, None) for one in chain(self.recordings, self.flow_recordings)}
        return [one for one in self.contradictions if used.intersection(contradicted_parts([one]))]

    @property
    def contradicted(self) -> list[LeftOut]:
        """What is left out because it cannot be true: recordings, or single signals of them."""
        used = {(one.name, None) for one in chain(self.recordings, self.flow_recordings)}
        return [LeftOut(*part) for part in contradicted_parts(self.contradictions) if part not in used]

    @classmethod
    def for_search(cls, context: Context) -> PipelineData:
        """Return the pipeline with the samples to which a search fits models: diagnosis, plan and baseline alike."""
        return cls(context).at_most(MAX_SAMPLES, by_at_least=MIN_REDUCTION)

    def at_most(self, max_samples: int, *, by_at_least: float = 1.0) -> PipelineData:
        """Return the pipeline with at most so many samples; itself where it has at most ``by_at_least`` times that."""
        few = sum(one.time.size for one in self.recordings) <= by_at_least * max_samples
        return self if few else replace(self, max_samples=max_samples)

    @property
    def subsampling(self) -> dict[str, int] | None:
        """The numbers of all samples and of those that are used; None where all are used."""
        names = {one.name for one in self.recordings}
        samples = sum(one.samples for one in self.ingested.recordings if one.name in names)
        used = sum(one.time.size for one in self.recordings)
        return {"samples": samples, "used": used} if used < samples else None

    @cached_property
    def available_effects(self) -> dict[str, Effect]:
        """The catalogue and the user's own effects."""
        return all_effects(plugin_files(self.context.config))

    @cached_property
    def excluded_effects(self) -> list[str]:
        """The names that ``--exclude`` lists; InputError where one is no effect."""
        names: list[str] = self.context.options.get("exclude", [])
        wanted = "an effect of the catalogue"
        require_known(names, self.available_effects, "--exclude", 'no effect "{}"', wanted, code="E030")
        return names

    @cached_property
    def effects(self) -> tuple[Effect, ...]:
        """The effects that the model has."""
        where = f"{self.context.path}, key model.effects"
        return select_effects(self.context.config.model.effects, self.available_effects, where)

    @property
    def valve(self) -> Literal["map", "linear", "switching", "pressure"]:
        """The form of the model's valve; a map needs the pressure in a chamber that the valve fills."""
        if self.rig.valve_kind != "proportional":
            return self.rig.valve_kind
        blind = without_pressure(self.recordings)
        return self.context.config.model.valve if not blind or tells_valve_map(self.recordings) else "linear"

    @cached_property
    def experiments(self) -> list[Experiment]:
        """Every recording made ready, restarted at the comparison's horizon."""
        compare = self.context.config.compare
        self._require_samples()
        if (hours := sum(r.time[-1] - r.time[0] for r in self.recordings) / 3600) > LONG_RECORDING_HOURS:
            self.context.progress(
                f"{format_plain(hours, 3)} h of recordings, if the unit of time is right: this takes long"
            )
        ready = []
        for i, recording in enumerate(self.recordings):
            self.context.progress(counted(f"smoothing {recording.name}", i, len(self.recordings)))
            ready.append(prepare(recording, self.rig, self.horizon, compare.low_pass))
            self._require_noise(ready[-1])
        release_free_memory()  # smoothing takes several times what it leaves
        return with_common_command_range(with_intersample_commands(with_end_stops(ready, self.rig), self.rig))

    def _require_noise(self, experiment: Experiment) -> None:
        """Raise InputError where a reading that the model is held against has no noise: errors count in units of it.

        An open chamber may well stand still at ambient pressure; it is only not fitted.
        """
        recording = experiment.recording
        still = ("p2",) if recording.chamber_2 == "open" else ()
        for name in experiment.channels:
            if name in experiment.noise and name not in still and not experiment.noise[name].rms > 0.0:
                found = f"{name} never changes in {recording.name} or any like it, so its noise is unknown"
                mend = f"leave {name} out of take if the sensor was dead, or state its noise in [signals] {name}"
                raise InputError(f"{self.context.path}, recording {recording.name}", found, "", mend, code="E060")

    @cached_property
    def data_digest(self) -> str:
        """Digest of what an error is an error of: the raw files, how they are read and used, and the horizon."""
        config, document = self.context.config, self.context.config.document
        files = [(one.name, one.use, one.sha256) for one in self.ingested.recordings]
        recordings = [{k: v for k, v in table.items() if k != "file"} for table in document.get("recordings", [])]
        read = (
            files,
            recordings,
            document.get("signals"),
            config.rig.ambient_pressure,
            config.compare.model_dump(exclude={"tolerance"}) | {"horizon": self.horizon},
        )
        return digest([*read, to_json(self.contradicted)] if self.contradicted else read)

    def _require_samples(self) -> None:
        """Raise InputError where a stated horizon holds next to no samples, as with time in a wrong unit."""
        horizon = self.horizon
        for recording in self.recordings:
            if MIN_HORIZON_SAMPLES * recording.period > horizon:
                period, stated = format_plain(recording.period), format_plain(horizon)
                found = f"{recording.name} has a sample every {period} s, the horizon is {stated} s"
                mend = 'state the unit of time, such as unit = "ms" in [signals] time, or else a longer horizon'
                raise InputError(
                    f"{self.context.path}, key compare.horizon",
                    found,
                    f"at least {MIN_HORIZON_SAMPLES} samples within a horizon",
                    mend,
                    code="E066",
                )

    def release_experiments(self) -> None:
        """Free what the experiments hold; they are made anew where they are asked for again."""
        self.__dict__.pop("experiments", None)
        release_free_memory()

    def guess(self) -> Model:
        """The model that a fit starts from; the same for every stage, to the last digit, so that they fit one model.

        Raises InputError where no training recording has a reading to fit.
        """
        if not self.residual_models("train"):
            where, wanted = f"{self.context.path}, key recordings", 'at least one with use = "train"'
            raise InputError(where, "no recording to train on", wanted, code="E061")
        train = [e for e in self.experiments if e.recording.use == "train"]
        return guess_base_model(train, self.rig, self.valve)

    @cached_property
    def identified_model(self) -> Model:
        """The model that ``identify`` wrote."""
        return load_model(self.context.artifacts / "identify", self.rig, self.effects)

    def residual_models(self, use: str) -> list[ResidualModel]:
        """The recordings of one use, one subsystem at a time; the same for every stage, so that they fit one model."""
        return residual_models([e for e in self.experiments if e.recording.use == use], whiten_initial_state=True)

    def tables(self, stage: str, *inputs: str) -> Tables:
        """Return what writes the tables of a stage, which it makes of these earlier artifacts."""
        return Tables(self.context.out, stage, self.provenance(*inputs))

    def provenance(self, *inputs: str) -> Provenance:
        """What made an artifact of this stage: earlier artifacts by path, and the file's own model and comparison."""
        document = self.context.config.document
        hashes = {name: sha256_of(self.context.artifacts / name) for name in inputs}
        return Provenance(hashes, {key: document.get(key, {}) for key in ("pipeline", "rig", "model", "compare")})


def require_stated(missing: Sequence[RequiredInput], path: Path) -> None:
    """Raise InputError with every key that is missing, what it is for, and an example."""
    faults = []
    for one in missing:
        below = one.table if one.table.startswith("[") else f"[{one.table}]"
        key = f"{one.table.strip('[]')}.{one.key}"
        mend = f"add {one.key} = {one.example} below {below}, with your rig's own number"
        faults.append(InputError(f"{path}, key {key}", "missing", one.wanted, mend, code="E063"))
    if faults:
        raise join_faults(path, faults)
