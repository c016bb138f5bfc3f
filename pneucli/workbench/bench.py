"""The pipeline on the bench: its file, its artifacts, the live model, and every change that the page may ask for."""

import shlex
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from typing import Any

from pneucli.compare import ChannelResult
from pneucli.config import load
from pneucli.config.effect_edit import replace_file, set_fixed
from pneucli.errors import InputError, UnitError, did_you_mean, require_known
from pneucli.io.artifacts import read_table
from pneucli.pipeline.graph import Context
from pneucli.pipeline.manifest import MANIFEST_FILE, read_answers
from pneucli.pipeline.runner import Pipeline
from pneucli.quantities import axis_motion
from pneucli.report.effect_figures import effect_figure
from pneucli.report.page_elements import Figure, Panel
from pneucli.report.report_data import ReportData, Table
from pneucli.report.sections import error_location, friction, valve
from pneucli.simulate.model import has_parameter
from pneucli.stages.compare import RESIDUALS_FILE
from pneucli.stages.history import recorded_models
from pneucli.stages.pipeline_data import PipelineData
from pneucli.stages.report import load_tables
from pneucli.units import parse_quantity
from pneucli.workbench import state
from pneucli.workbench.commands import Command, CommandRunner
from pneucli.workbench.live_model import LiveModel, Variant
from pneucli.workbench.prediction import Interval, visible

CHAPTERS = {"where": error_location, "valve": valve, "friction": friction}
DROPPED = "dropped"  # folder beside the pipeline file, for recordings that are dropped onto the page
MAX_UNDO = 50  # changes of the file that can be taken back
CHANGED_MEANWHILE = "the pipeline file has changed since this page was drawn; it is shown anew, nothing was done"


@dataclass(frozen=True)
class Change:
    """One change of the pipeline file: what it did, the text before, the digest after, and its command back."""

    title: str
    before: bytes
    after: str
    line: str


@dataclass
class Bench:
    """One pipeline.

    Attributes:
        file: The pipeline file.
        out: The folder of the artifacts; None: the usual one.
        open_pipeline: Opens the file.
        runner: Runs commands.
        live: The model in memory; None before it is loaded, or where there is none.
        problem: Why there is no live model, for people.

    """

    file: Path
    out: Path | None
    open_pipeline: Callable[[], Pipeline]
    runner: CommandRunner
    live: LiveModel | None = None
    problem: str = ""
    changes: list[Change] = field(default_factory=list)
    _loaded: tuple[Any, ...] = ()
    _stored: tuple[Path | None, Mapping[str, Any]] = (None, {})

    @property
    def artifacts(self) -> Path:
        """The folder of the artifacts."""
        return self.open_pipeline().artifacts

    @property
    def version(self) -> str:
        """The digest of the pipeline file, by which a page says what it has seen."""
        return state.digest_of(self.file)

    def stamp(self) -> tuple[Any, ...]:
        """Return what changes when anyone changes the file or an answer."""
        try:
            manifests = [self.artifacts / name / MANIFEST_FILE for name in state.SHOWN_STAGES]
        except InputError:
            manifests = []
        paths = [self.file, *manifests]
        return tuple(path.stat().st_mtime_ns if path.exists() else 0 for path in paths)

    def refresh(self) -> None:
        """Load the identified model anew where it has changed; ``problem`` says why where that fails."""
        try:
            pipeline = self.open_pipeline()
            answers = read_answers(pipeline.artifacts, state.SHOWN_STAGES)
            key = tuple((answers.get(name) or {}).get("when") for name in ("compare", "diagnose"))
            key = (*key, self.version, *self.stamp())
            if key == self._loaded and self.live is not None:
                return
            self._loaded = key
            self.problem = self._obstacle(pipeline, answers)
            if not self.problem:
                config = pipeline.load(pipeline.path)
                context = Context(pipeline.path, config, pipeline.artifacts, pipeline.artifacts, answers=answers)
                with axis_motion(rotary=config.rotary):
                    self.live = LiveModel(PipelineData(context), answers, self.live)
        except InputError as error:
            self.problem = str(error)

    @staticmethod
    def _obstacle(pipeline: Pipeline, answers: Mapping[str, Any]) -> str:
        """Return why the identified model cannot be loaded; empty where it can."""
        if "compare" not in answers:
            return "The model has not been fitted yet."
        present = pipeline.tables.get("model", {}).get("effects", [])
        if sorted(answers["compare"]["model"]["effects"]) != sorted(present):
            return "The pipeline file has other effects than the fitted model: press Fit."
        if not (pipeline.artifacts / "identify" / "model.parquet").is_file():
            return "These recordings have no clock: there is nothing to simulate over time."
        return ""

    def describe(self) -> dict[str, Any]:
        """Return everything that the page shows but the curves."""
        try:
            pipeline = self.open_pipeline()
            config = pipeline.load(pipeline.path)
        except InputError as error:
            return {"version": self.version, "broken": str(error), "command": self._command()}
        answers = read_answers(pipeline.artifacts, state.SHOWN_STAGES)
        with axis_motion(rotary=config.rotary):
            catalogue = self.live.available_effects if self.live else {}
            return {
                "version": self.version,
                **state.overview(pipeline, answers),
                "problem": self.problem,
                "live": self.live is not None and not self.problem,
                "effects": state.effects(catalogue, config.model.effects, answers),
                "parameters": state.parameters(answers, None if self.problem else self.live),
                "ladder": state.ladder(pipeline.artifacts),
                "recordings": state.recordings(answers, self.live.places if self.live and not self.problem else {}),
                "lines": {one: shlex.join(["pneucli", *words]) for one, words in self._command_words().items()},
                "undo": {"title": self.changes[-1].title, "line": self.changes[-1].line} if self.changes else None,
                "report": (pipeline.artifacts / "report" / "report.html").is_file(),
                "chapters": list(CHAPTERS),
                "command": self._command(),
            }

    def _command(self) -> dict[str, Any] | None:
        return None if self.runner.last is None else self.runner.last.as_json()

    def require_version(self, seen: str) -> None:
        """Raise InputError where the file is not what the page has seen."""
        if seen != self.version:
            raise InputError(self.file.name, CHANGED_MEANWHILE, code="E006")

    # commands

    def words(self, action: str, names: Sequence[str]) -> list[str]:
        """Return the command line behind an action of the page; raises InputError for an unknown one or effect."""
        known = self._command_words()
        if action in known:
            return known[action]
        if action == "init" and len(names) == 1:
            return self._init_words(names[0])
        if action not in ("add", "remove") or not names:
            raise InputError("the workbench", f'no action "{action}"', mend=did_you_mean(action, known), code="E091")
        available = self.live.available_effects if self.live else {}
        require_known(names, available, "the workbench", 'no effect "{}"', code="E030")
        return [action, *self._file_words(), *names]

    def _command_words(self) -> dict[str, list[str]]:
        """Return the command line behind each button."""
        rest = self._file_words()
        words = {"fit": ["compare", *rest], "diagnose": ["diagnose", *rest], "plan": ["plan", *rest]}
        return words | {"report": ["report", *rest], "add-named": ["add", *rest, "--suggested"]}

    def _file_words(self) -> list[str]:
        return [self.file.name, *(["--out", str(self.out)] if self.out else [])]

    def _init_words(self, name: str) -> list[str]:
        """Return the command line that makes a pipeline of a dropped recording, in a folder of its own."""
        path = Path(name)
        if path.parent != Path(DROPPED) or path.name.startswith("-") or not (self.file.parent / path).is_file():
            raise InputError("the workbench", f'"{name}" was not dropped', "a dropped recording", code="E002")
        return ["init", f"{DROPPED}/{path.stem}", "--from", name]

    async def run(self, action: str, names: Sequence[str]) -> Command:
        """Run a command; remember its change of the pipeline file, so that it can be undone."""
        words = self.words(action, names)
        before, effects = self.file.read_bytes(), self._effects()
        command = await self.runner.run(words)
        if self.file.read_bytes() != before:
            self._remember(" ".join([words[0], *names]), before, self._line_back(effects))
        return command

    def _effects(self) -> list[str]:
        return list(self.open_pipeline().tables.get("model", {}).get("effects", []))

    def _line_back(self, effects: Sequence[str]) -> str:
        """Return the command line that brings the effects back."""
        now = self._effects()
        added, removed = [n for n in now if n not in effects], [n for n in effects if n not in now]
        parts = [("remove", added), ("add", removed)]
        return " && ".join(f"pneucli {word} {self.file.name} {' '.join(names)}" for word, names in parts if names)

    def _remember(self, title: str, before: bytes, line: str) -> None:
        self.changes = [*self.changes, Change(title, before, self.version, line)][-MAX_UNDO:]

    def undo(self) -> None:
        """Take the last change of the file back; raises InputError where another program has changed it since."""
        if not self.changes:
            raise InputError(self.file.name, "there is nothing to undo", code="E091")
        last = self.changes[-1]
        if self.version != last.after:
            self.changes.clear()
            raise InputError(
                self.file.name,
                "another program has changed it since; undo would lose that",
                mend="change the file by hand, or remove the effect from the list",
                code="E006",
            )
        replace_file(self.file, last.before)
        self.changes.pop()

    def fix(self, name: str, value: float | None, unit: str) -> None:
        """Fix a parameter in the pipeline file at a value in ``unit``, or free it.

        The file stays as it was where it would not be valid.
        """
        if not has_parameter(model := self.require_live().model, name):
            known = [*model.values, *model.valve_parameters()]
            raise InputError("the workbench", f'no parameter "{name}"', mend=did_you_mean(name, known), code="E091")
        before = self.file.read_bytes()
        quantity = value if value is None or unit == "1" else f"{value:.9g} {unit}"
        set_fixed(self.file, name, quantity)
        try:
            load(self.file)
        except InputError:
            replace_file(self.file, before)
            raise
        if self.file.read_bytes() != before:
            self._remember(f"{'free' if value is None else 'fix'} {name}", before, "")

    @staticmethod
    def quantity(text: str, unit: str) -> float:
        """Return a typed quantity in SI; raises InputError where it cannot be read."""
        try:
            return parse_quantity(text, unit, difference=True)
        except UnitError as error:
            raise InputError("the value", str(error), code="E024") from error

    # what is drawn

    def require_live(self) -> LiveModel:
        """Return the live model; raises InputError where there is none."""
        if self.live is None or self.problem:
            raise InputError(self.file.name, self.problem or "the recordings are being read", code="E007")
        return self.live

    def curves(
        self,
        wanted: Variant,
        focus: str,
        interval: Interval | None,
        max_samples: int,
        earlier: int | None,
        moving: str | None,
    ) -> tuple[list[Panel], dict[str, Any]]:
        """Return the panels of all recordings, with those of an earlier model of the ladder as the model before."""
        live = self.require_live()
        before = None if earlier is None else (earlier, partial(self._stored_tables, earlier))
        with axis_motion(rotary=live.rotary):
            return live.curves(wanted, focus, interval, max_samples, before, moving)

    def simulate(self, wanted: Variant, focus: str, interval: Interval | None) -> None:
        """Simulate what is visible, so that the next curves need not."""
        live = self.require_live()
        with axis_motion(rotary=live.rotary):
            live.simulated(wanted, focus, tuple(visible(live.places, interval)))

    def errors(self, wanted: Variant, focus: str, recording: str) -> tuple[ChannelResult, ...]:
        """Return the errors of one recording."""
        return self.require_live().errors(wanted, focus, recording)

    def _stored_tables(self, number: int, recording: str) -> dict[str, Table]:
        """Return what ``compare`` stored of an earlier model for one recording, by channel."""
        records = recorded_models(self.artifacts / "compare")
        path = next((one.folder / RESIDUALS_FILE for one in records if one.answer["number"] == number), None)
        if path is None or not path.is_file():
            raise InputError("the ladder", f"there is no model {number} any more", code="E091")
        if self._stored[0] != path:
            self._stored = path, read_table(path)
        rows = Table(self._stored[1]).where(recording=recording)
        return {str(channel): one for (channel,), one in rows.groups("channel")}

    def chapter(self, name: str) -> list[dict[str, str]]:
        """Return the figures of a chapter of the report: maps of the residual, the valve map, or friction."""
        require_known([name], CHAPTERS, "the workbench", 'no chapter "{}"', code="E091")
        pipeline = self.open_pipeline()
        config = pipeline.load(pipeline.path)
        with axis_motion(rotary=config.rotary):
            answers = read_answers(pipeline.artifacts, state.SHOWN_STAGES)
            section = CHAPTERS[name].section(ReportData(pipeline.name, answers, load_tables(pipeline.artifacts)))
        parts = section.parts if section else ()
        return [{"caption": one.caption, "svg": one.svg} for one in parts if isinstance(one, Figure)]

    def effect(self, name: str) -> dict[str, str]:
        """Return what the catalogue says of an effect, with its picture."""
        available = self.live.available_effects if self.live else {}
        require_known([name], available, "the catalogue", 'no effect "{}"', code="E030")
        one = available[name]
        texts = {"title": one.title, "looks_like": one.looks_like, "separate": one.separate, "source": one.source}
        try:
            return texts | {"svg": effect_figure(one)}
        except ValueError:  # it shows in no standard experiment
            return texts | {"svg": ""}
