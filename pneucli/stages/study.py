"""What the stages after ingest share: recordings, effects and options as domain objects; the model file."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Literal

import numpy as np

from pneucli.config import plugin_files
from pneucli.errors import InputError
from pneucli.identify.views import View, views_of
from pneucli.io.artifacts import Provenance, read_table, sha256_of, write_table
from pneucli.io.recordings import load_recordings
from pneucli.physics.declaration import Effect
from pneucli.physics.effects import all_effects, select
from pneucli.pipeline.context import Context
from pneucli.pipeline.staleness import digest
from pneucli.recording import Recording, Rig
from pneucli.simulate.experiment import Experiment, prepare
from pneucli.simulate.linear_valve import LinearValve
from pneucli.simulate.model import Model, Valve
from pneucli.simulate.valve_area import ValveArea

MODEL_FILE = "model.parquet"
FEWEST = 5  # samples within a horizon
LONG = 1.0  # h of recordings in all: one run of the model through them takes a second and more


@dataclass(frozen=True)
class Study:
    """The pipeline as the domain packages see it."""

    context: Context

    @cached_property
    def rig(self) -> Rig:
        """What is known of the rig."""
        return self.context.config.to_rig()

    @cached_property
    def recordings(self) -> list[Recording]:
        """All recordings, in the pipeline file's order."""
        return load_recordings(self.context.artifacts / "ingest")

    @cached_property
    def known_effects(self) -> dict[str, Effect]:
        """The catalogue and the user's own effects."""
        return all_effects(plugin_files(self.context.config))

    @cached_property
    def effects(self) -> tuple[Effect, ...]:
        """The effects that the model has."""
        where = f"{self.context.path}, key model.effects"
        return select(self.context.config.model.effects, self.known_effects, where)

    @property
    def valve(self) -> Literal["map", "linear"]:
        """The form of the model's valve."""
        return self.context.config.model.valve

    @cached_property
    def experiments(self) -> list[Experiment]:
        """Every recording made ready, restarted at the comparison's horizon."""
        compare = self.context.config.compare
        self._require_samples(compare.horizon)
        if (hours := sum(r.time[-1] - r.time[0] for r in self.recordings) / 3600) > LONG:
            self.context.progress(f"{hours:.3g} h of recordings, if the unit of time is right: this takes long", 0.0)
        ready = []
        for i, recording in enumerate(self.recordings):
            self.context.progress(f"smoothing {recording.name}", 0.2 * i / len(self.recordings))
            ready.append(prepare(recording, self.rig, compare.horizon, compare.low_pass))
            self._require_noise(ready[-1])
        return ready

    def _require_noise(self, experiment: Experiment) -> None:
        """Raise InputError where a reading that the model is held against has no noise: errors count in units of it.

        An open chamber may well stand still at ambient pressure; it is only not fitted.
        """
        recording = experiment.recording
        still = ("p2",) if recording.chamber_2 == "open" else ()
        for name in experiment.channels:
            if name in experiment.noise and name not in still and not experiment.noise[name].rms > 0.0:
                found = f"{name} never changes in {recording.name} or any like it, so its noise is not known"
                mend = f"leave {name} out of take if the sensor was dead, or state its noise in [signals] {name}"
                raise InputError(f"{self.context.path}, recording {recording.name}", found, "", mend)

    @cached_property
    def data(self) -> str:
        """Digest of what an error is an error of: the raw files, how they are read and used, and the horizon."""
        config, document = self.context.config, self.context.config.document
        files = [(r["name"], r["use"], r["sha256"]) for r in self.context.answers["ingest"]["recordings"]]
        recordings = [{k: v for k, v in table.items() if k != "file"} for table in document.get("recordings", [])]
        read = (files, recordings, document.get("signals"), config.rig.ambient_pressure, config.compare.model_dump())
        return digest(read)

    def _require_samples(self, horizon: float) -> None:
        """Raise InputError where a horizon holds next to no samples, as with time in a wrong unit: it takes minutes."""
        for recording in self.recordings:
            if FEWEST * recording.period > horizon:
                found = f"{recording.name} has a sample every {recording.period:g} s, the horizon is {horizon:g} s"
                mend = 'state the unit of time, such as unit = "ms" in [signals] time, or else a longer horizon'
                raise InputError(
                    f"{self.context.path}, key compare.horizon",
                    found,
                    f"at least {FEWEST} samples within a horizon",
                    mend,
                )

    def forget_experiments(self) -> None:
        """Free what the experiments hold; they are made anew where they are asked for again."""
        self.__dict__.pop("experiments", None)

    def views(self, use: str, *, whitened: bool = False) -> list[View]:
        """The recordings of one use, one subsystem at a time."""
        return views_of([e for e in self.experiments if e.recording.use == use], whitened=whitened)

    def provenance(self, *inputs: str) -> Provenance:
        """What made an artifact of this stage: earlier artifacts by path, and the file's own model and comparison."""
        document = self.context.config.document
        hashes = {name: sha256_of(self.context.artifacts / name) for name in inputs}
        return Provenance(hashes, {key: document.get(key, {}) for key in ("pipeline", "rig", "model", "compare")})


def save_model(model: Model, folder: Path, provenance: Provenance) -> None:
    """Write a model's values and its valve."""
    rows = [("value", name, np.nan, value) for name, value in model.values.items()] + _valve_rows(model.valve)
    kind, name, command, value = zip(*rows, strict=True)
    write_table(
        folder / MODEL_FILE,
        {"kind": list(kind), "name": list(name), "command": np.array(command), "value": np.array(value)},
        units={"command": "V", "value": "SI"},
        schema="pneucli/identify/model/1",
        provenance=provenance,
    )


def _valve_rows(valve: Valve) -> list[tuple[str, str, float, float]]:
    if isinstance(valve, LinearValve):
        return [("gain", "", np.nan, valve.gain)]
    overlaps = (("fill", valve.overlap_fill), ("vent", valve.overlap_vent))
    rows = [("area", "", c, a) for c, a in zip(valve.commands, valve.areas, strict=True)]
    return rows + [("overlap", name, np.nan, value) for name, value in overlaps]


def load_model(folder: Path, rig: Rig, effects: tuple[Effect, ...]) -> Model:
    """Return the model that ``identify`` wrote."""
    table = read_table(folder / MODEL_FILE)
    rows = list(zip(table["kind"], table["name"], table["command"], table["value"], strict=True))
    values = {str(n): float(v) for k, n, _, v in rows if k == "value"}
    knots = [(float(c), float(v)) for k, _, c, v in rows if k == "area"]
    overlap = {str(n): float(v) for k, n, _, v in rows if k == "overlap"}
    gains = [float(v) for k, _, _, v in rows if k == "gain"]
    if gains:
        return Model(rig, effects, values, LinearValve(*gains))
    valve = ValveArea(tuple(c for c, _ in knots), tuple(a for _, a in knots), overlap["fill"], overlap["vent"])
    return Model(rig, effects, values, valve)
