"""Bring stages up to date: run only stale stages, state why, one run at a time, safe if killed."""

from __future__ import annotations

import importlib
import json
import os
import re
import time
from collections.abc import Callable, Iterable, Mapping
from contextlib import suppress
from dataclasses import asdict, dataclass, field, replace
from pathlib import Path
from typing import Any

from pneucli.document import read_toml
from pneucli.errors import InputError, printable
from pneucli.imports import load_on_use, paused_collection
from pneucli.messages.progress import starting
from pneucli.pipeline import manifest as staleness
from pneucli.pipeline import workload
from pneucli.pipeline.graph import NO_PROGRESS, STAGES, Context, NotApplicable, Progress, Stage, Workload, upstream
from pneucli.pipeline.manifest import Inputs, Manifest, Stamp
from pneucli.quantities import axis_motion, in_axis_units

VALIDATED_FILE = ".validated"
EXECUTOR_OPTION = "executor"
MAX_NAME_LENGTH = 60  # characters, of up to four bytes each
Options = Mapping[str, Mapping[str, Any]]


@dataclass(frozen=True)
class StageStatus:
    """The status of one stage: ``reasons`` says why it is stale, and is empty where it is up to date.

    ``executor_option`` is the option that names the executor, on which no answer depends.
    """

    inputs: Inputs
    manifest: Manifest | None
    reasons: tuple[str, ...]
    executor_option: Mapping[str, Any] = field(default_factory=dict)


@dataclass(frozen=True)
class Done:
    """One stage that is up to date: its manifest, and the reasons for which it ran (empty: it did not)."""

    manifest: Manifest
    reasons: tuple[str, ...] = ()

    @property
    def answer(self) -> dict[str, Any]:
        """The stage's JSON answer; raises NotApplicable where the stage does not apply to the pipeline."""
        if self.manifest.skipped is not None or self.manifest.answer is None:
            raise NotApplicable(**(self.manifest.skipped or {}))
        return self.manifest.answer


@dataclass(frozen=True)
class Pipeline:
    """A pipeline file and the folder of its artifacts; ``load`` validates the file (raises InputError).

    ``prepare`` is called before a stage runs; ``workload`` returns what the stage of a name has before it, from its
    context and input files, None where nobody knows.
    """

    path: Path
    tables: Mapping[str, Any]
    artifacts: Path
    load: Callable[[Path], Any]
    stages: Mapping[str, Stage] = field(default_factory=lambda: STAGES)
    program: str = field(default_factory=staleness.program_digest)
    prepare: Callable[[], None] = lambda: None
    workload: Callable[[str, Context, Mapping[str, Stamp]], Workload | None] = lambda name, context, files: None

    @property
    def name(self) -> str:
        """Name of the pipeline."""
        return str(self.tables["pipeline"]["name"])

    def stage_status(self, targets: Iterable[str], options: Options | None = None) -> dict[str, StageStatus]:
        """Return the status of ``targets`` and all stages that they need, parents first; run and write nothing.

        ``options`` maps a stage to its command line options; other stages keep those of their last run.
        """
        own = self._with_options(options or {})
        return own._stage_status(targets, options)

    def _with_options(self, options: Options) -> Pipeline:
        """Return the pipeline whose stages read what they need with these options, or with those of their last run."""
        stages = {}
        for name, stage in self.stages.items():
            former = staleness.read_manifest(self.artifacts / name) if stage.alone and name not in options else None
            stages[name] = stage.with_options(options.get(name) or (former.inputs.options if former else {}))
        return replace(self, stages=stages)

    def _stage_status(self, targets: Iterable[str], options: Options | None) -> dict[str, StageStatus]:
        verdicts: dict[str, StageStatus] = {}
        for name in upstream(targets, self.stages):
            manifest = staleness.read_manifest(self.artifacts / name)
            asked = (options or {}).get(name)
            inputs = self._inputs(name, manifest, verdicts, asked)
            outputs = staleness.stamp_files(self.artifacts / name, manifest.outputs) if manifest else {}
            why = staleness.stale_reasons(manifest, inputs, outputs)
            if manifest and not why:
                manifest = replace(manifest, inputs=inputs, outputs=outputs)
            verdicts[name] = StageStatus(
                inputs, manifest, why, {k: v for k, v in (asked or {}).items() if k == EXECUTOR_OPTION}
            )
        return verdicts

    def _inputs(
        self,
        name: str,
        manifest: Manifest | None,
        verdicts: Mapping[str, StageStatus],
        options: Mapping[str, Any] | None,
    ) -> Inputs:
        stage = self.stages[name]
        files = staleness.named_files(self.tables, *stage.files, self.path) if stage.files else {}
        previous = manifest.inputs.files if manifest else {}
        before = manifest.inputs.options if manifest else {}
        return Inputs(
            program=self.program,
            tables={table: staleness.digest(self.tables[table]) for table in stage.tables if table in self.tables},
            files={label: staleness.stamp(path, previous.get(label)) for label, path in files.items()},
            parents={parent: verdicts[parent].inputs.key for parent in (*stage.parents, *stage.optional)},
            options={k: v for k, v in (before if options is None else options).items() if k != EXECUTOR_OPTION},
        )

    def update(
        self,
        targets: Iterable[str],
        options: Options | None = None,
        progress: Progress = NO_PROGRESS,
        notify: Callable[[str], None] = lambda message: None,
    ) -> dict[str, Done]:
        """Bring ``targets`` and all stages that they need up to date; return each of them, parents first.

        A killed run leaves each stage's folder complete, old or new; the next run continues from there. Raises the
        errors of the stages, and InputError where the pipeline file is at fault.
        """
        own = self._with_options(options or {})
        return own._update(list(targets), options, progress, notify)

    def _update(
        self, targets: list[str], options: Options | None, progress: Progress, notify: Callable[[str], None]
    ) -> dict[str, Done]:
        config = self.validate()
        staleness.require_own_files(self.artifacts, upstream(targets, self.stages))
        with staleness.folder_lock(self.artifacts, notify):
            self.require_own_folder()
            if config is not None:
                self._remember_valid()
            for name in self.stages:
                staleness.recover_folder(self.artifacts, name)
            verdicts = self._stage_status(targets, options)
            if config is None and any(verdict.reasons for verdict in verdicts.values()):
                config = self.load(self.path)
            done: dict[str, Done] = {}
            for name, verdict in verdicts.items():
                done[name] = self._update_stage(name, verdict, done, config, progress, notify)
        return done

    def require_own_folder(self) -> None:
        """Raise InputError where the default folder holds the artifacts of another pipeline of the same name.

        A file that is no longer there, or that has another name by now, was moved or renamed: its folder is taken over.
        """
        owner = self._note()[1]
        if not owner or self.artifacts != _default_folder(self.path, self.name):
            return
        other = Path(os.path.normpath(self.artifacts / owner))
        if other.is_file() and not other.samefile(self.path) and _name_in(other) == self.name:
            raise InputError(
                f"{self.path}, key pipeline.name",
                f'"{self.name}" is also the name of {other}, whose artifacts are in {self.artifacts}',
                "a name for each pipeline of a folder",
                "rename one of them, or name another folder with --out",
                code="E026",
            )

    def validate(self) -> Any:
        """Return the validated pipeline file; ``None`` where this program has validated this text before."""
        return None if self._note() == (self._text_digest(), self._own_path()) else self.load(self.path)

    def _remember_valid(self) -> None:
        if re.fullmatch("[0-9a-f]*", self._note()[0]):  # else another program wrote the file
            text = f"{self._text_digest()}\n{self._own_path()}\n"
            (self.artifacts / VALIDATED_FILE).write_text(text, encoding="utf-8")

    def _own_path(self) -> str:
        """Return the pipeline file's path from the artifacts' folder: both may be moved together."""
        try:
            return Path(os.path.relpath(self.path, self.artifacts)).as_posix()
        except ValueError:  # another drive
            return str(self.path)

    def _note(self) -> tuple[str, str]:
        """Return the digest of the text that was validated last, and the path of its file."""
        marker = self.artifacts / VALIDATED_FILE
        text = marker.read_text(encoding="utf-8", errors="replace") if marker.is_file() else ""
        validated, _, owner = text.partition("\n")
        return validated, owner.strip()

    def _text_digest(self) -> str:
        return staleness.digest([self.program, staleness.stamp(self.path).sha256])

    def _update_stage(
        self,
        name: str,
        verdict: StageStatus,
        done: Mapping[str, Done],
        config: Any,
        progress: Progress,
        notify: Callable[[str], None],
    ) -> Done:
        if verdict.manifest and not verdict.reasons:
            if verdict.manifest != staleness.read_manifest(
                self.artifacts / name
            ):  # only time stamps changed: store the new ones
                verdict.manifest.write(self.artifacts / name)
            return Done(verdict.manifest)
        manifest = Manifest(name, verdict.inputs, skipped=self._skipped_parent(name, done))
        with staleness.replace_folder(self.artifacts, name) as out:
            if manifest.skipped is None:
                answers = {n: d.manifest.answer for n, d in done.items() if d.manifest.answer is not None}
                options, former = {**verdict.inputs.options, **verdict.executor_option}, self.artifacts / name
                context = Context(self.path, config, out, self.artifacts, progress, answers, options, former)
                work = self._begin(name, context, verdict, notify)
                self.prepare()
                manifest = _run(self.stages[name], context, manifest)
                if work is not None and manifest.skipped is None:
                    workload.remember(name, self.path, work.units, manifest.seconds)
            manifest.write(out)
        return Done(manifest, verdict.reasons)

    def _begin(
        self, name: str, context: Context, verdict: StageStatus, notify: Callable[[str], None]
    ) -> Workload | None:
        """Say what the stage will do and about how long; return what it has before it."""
        work = self.workload(name, context, verdict.inputs.files)
        seconds = None if work is None else workload.estimate(name, self.path, work.units)
        reasons = [reason.replace(staleness.NEVER_RUN, "first time") for reason in verdict.reasons]
        notify(starting(name, reasons, None if work is None else work.text, seconds))
        context.progress.begin(name, seconds)
        return work

    def _skipped_parent(self, name: str, done: Mapping[str, Done]) -> Mapping[str, Any] | None:
        skipped = (done[parent].manifest.skipped for parent in self.stages[name].parents)
        return next((reason for reason in skipped if reason is not None), None)


def _run(stage: Stage, context: Context, manifest: Manifest) -> Manifest:
    """Run the stage into ``context.out``; return its manifest."""
    start = time.monotonic()
    with paused_collection():
        load_on_use("numpy", "f2py", "ma", "testing")  # scipy asks numpy for all of its modules
        module = importlib.import_module(stage.module)
    from threadpoolctl import threadpool_limits  # noqa: PLC0415 - it limits what is loaded when it is asked

    try:
        # on small matrices BLAS threads only wait for each other, and their number changes the last digits
        with (
            axis_motion(rotary=getattr(context.config, "rotary", False)),  # other pipelines have no axis
            threadpool_limits(1, user_api="blas"),
        ):
            answer = json.loads(
                json.dumps(in_axis_units(module.run(context)), allow_nan=False)
            )  # as a later run will read it
    except NotApplicable as error:
        return replace(manifest, skipped=asdict(error))
    return replace(
        manifest,
        outputs=staleness.stamp_files(context.out),
        answer=answer,
        seconds=round(time.monotonic() - start, 3),
    )


def open_pipeline(
    path: Path, load: Callable[[Path], Any], out: Path | None = None, stages: Mapping[str, Stage] = STAGES
) -> Pipeline:
    """Open a pipeline file; its artifacts go to ``out``, by default ``artifacts/NAME`` next to the file.

    Raises InputError where the file cannot be read as TOML, has no usable name, or has that of another pipeline in this
    folder; ``load`` reports all other errors.
    """
    path = Path(path).absolute()
    _, tables = read_toml(path)
    name = tables.get("pipeline", {}).get("name") if isinstance(tables.get("pipeline"), dict) else None
    if not isinstance(name, str):
        load(path)
        raise InputError(
            f"{path}, key pipeline.name", "no name", 'a text such as "bench-3"', "give the pipeline one", code="E022"
        )
    _require_folder_name(name, f"{path}, key pipeline.name")
    pipeline = Pipeline(path, tables, (out or _default_folder(path, name)).absolute(), load, stages)
    pipeline.require_own_folder()
    return pipeline


def _default_folder(path: Path, name: str) -> Path:
    return path.parent / "artifacts" / name


def _name_in(path: Path) -> Any:
    """Return the name that a pipeline file states; none where it cannot be read."""
    with suppress(InputError, OSError, KeyError, TypeError):
        return read_toml(path)[1]["pipeline"]["name"]
    return None


def _require_folder_name(name: str, where: str) -> None:
    """Raise an InputError where ``name`` cannot be the name of a folder."""
    plain = printable(name) == name.strip() and not set(name) & set('/\\:*?"<>|')
    if not plain or not name or len(name) > MAX_NAME_LENGTH or name.startswith("."):
        found = f'"{name[:MAX_NAME_LENGTH]}" cannot be the name of a folder'
        raise InputError(where, found, f"up to {MAX_NAME_LENGTH} letters, digits, - and _", "rename it", code="E026")
