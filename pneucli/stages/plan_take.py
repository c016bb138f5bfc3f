"""``plan --take``: the recordings of a plan into the pipeline file, and what they decide."""

import os
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from pneucli.config.effect_edit import append_recordings
from pneucli.document import read_toml
from pneucli.errors import InputError
from pneucli.figure import named, read
from pneucli.messages import diagnose
from pneucli.messages.plan import Answer as Plan
from pneucli.messages.plan import (
    Decided,
    Diagnosed,
    PlannedRecording,
    Taken,
    TakenEffect,
    TakenParameter,
    TakenRecording,
    taken_sentence,
)
from pneucli.pipeline.manifest import read_manifest

OWN_KEYS = frozenset(
    {"name", "file", "use", "test", "from", "to", "more", "valve", "force", "added_mass", "x_ref", "p_ref"}
)
MIN_SHOWN_PROBABILITY = 0.05  # of an effect, before or after
IDENTITY_KEYS = ("experiment", "chamber_2", "imposed", "chamber")


def last_answers(artifacts: Path, file: Path) -> tuple[diagnose.Answer, Plan]:
    """Return the answers of the last diagnosis and of the last plan; raises InputError where there is no plan.

    A plan from the rig's description alone has no diagnosis before it; its answer is then empty.
    """
    plan, diagnosis = (read_manifest(artifacts / name) for name in ("plan", "diagnose"))
    if plan is None or plan.answer is None:
        raise InputError(
            f"{file}", "no plan whose recordings could be taken", "a plan", f"pneucli plan {file}", code="E007"
        )
    return read(diagnose.Answer, (diagnosis and diagnosis.answer) or {}), read(Plan, plan.answer)


def add_recordings(file: Path, plan: Plan, paths: Sequence[Path]) -> list[dict[str, Any]]:
    """Add recordings of a plan to the pipeline file.

    A file belongs to the planned recording of its name, else the files are those of all planned recordings in their
    order. One file for a plan of several recordings holds them all, with the clock of ``commands.csv``.

    Args:
        file: The pipeline file.
        plan: The answer of the plan.
        paths: The raw files.

    Returns:
        The added tables.

    Raises:
        InputError: A file does not exist or is in the pipeline already, or their number does not fit the plan.
    """
    for path in paths:
        if not path.is_file():
            raise InputError(str(path), "no such file", "a recording of the plan", "check the path", code="E002")
    _, document = read_toml(file)
    present = document.get("recordings", [])
    used = {str(table.get("file")): table.get("name") for table in present}
    for path in paths:
        if (written := _relative(path, file)) in used:
            found = f'{file} has it already as "{used[written]}"'
            raise InputError(
                str(path), found, "a new file", f"pneucli diagnose {file}, if it was recorded anew", code="E031"
            )
    taken = {str(table.get("name", table.get("file"))) for table in present}
    tables = []
    for planned, path, is_part in _matched(plan.recordings, paths):
        name = _free_name(planned.name, taken)
        taken.add(name)
        table = {"name": name, "file": _relative(path, file)}
        table |= _table(planned, present)
        if is_part:
            table |= {"from": f"{planned.begin:.3f} s", "to": f"{planned.end:.3f} s"}
        tables.append(table)
    append_recordings(file, tables)
    return tables


def _relative(path: Path, file: Path) -> str:
    return Path(os.path.relpath(path.absolute(), file.absolute().parent)).as_posix()


def _matched(planned: Sequence[PlannedRecording], paths: Sequence[Path]) -> list[tuple[PlannedRecording, Path, bool]]:
    """Return each planned recording with its file, and whether it is a part of the file."""
    by_name = {one.name: one for one in planned}
    if all(path.stem in by_name for path in paths):
        return [(by_name[path.stem], path, False) for path in paths]
    if len(paths) == 1 and len(planned) > 1:
        return [(one, paths[0], True) for one in planned]
    if len(paths) != len(planned):
        found = f"{len(paths)} files for {len(planned)} planned recordings"
        mend = f"name the files as steps.md does: {', '.join(f'{name}.csv' for name in by_name)}"
        raise InputError("--take", found, "a file for each, or files named as planned", mend, code="E031")
    return [(one, path, False) for one, path in zip(planned, paths, strict=True)]


def _free_name(name: str, taken: set[str]) -> str:
    if name not in taken:
        return name
    number = 2
    while f"{name}_{number}" in taken:
        number += 1
    return f"{name}_{number}"


def _table(planned: PlannedRecording, present: Sequence[Mapping[str, Any]]) -> dict[str, Any]:
    """Return the table of a planned recording: as those of its bench, with what the plan held."""
    identity = named(planned, " ".join(IDENTITY_KEYS))
    own = {key: value for key, value in identity.items() if value is not None and (key, value) != ("chamber", 1)}
    alike = next(
        (t for t in present if all(t.get(k, 1 if k == "chamber" else None) == identity[k] for k in IDENTITY_KEYS)), {}
    )
    table: dict[str, Any] = {key: value for key, value in alike.items() if key not in OWN_KEYS}
    table |= own | {"use": planned.use}
    if planned.valve:
        table["valve"] = planned.valve
    if planned.force:
        table |= {"force": f"{planned.force:.4g} N", "added_mass": f"{planned.added_mass:.4g} kg"}
    return table


def taken_answer(
    before: diagnose.Answer, after: diagnose.Answer, plan: Plan, added: Sequence[Mapping[str, Any]]
) -> Taken:
    """Return what the new recordings changed: verdicts, probabilities, parameters, what is decided now."""
    effects = _effects(before, after, plan)
    decided = [Decided(e.effect, e.now) for e in effects if e.now is not None]
    return Taken(
        schema="pneucli/plan-taken/1",
        pipeline=after.pipeline,
        recordings=[TakenRecording(t["name"], t["file"], t["use"]) for t in added],
        before=_summary(before),
        after=_summary(after),
        effects=effects,
        decided=decided,
        parameters=_parameters(before, after),
        sentence=taken_sentence(after.missing, decided),
    )


def _summary(answer: diagnose.Answer) -> Diagnosed:
    alone = {c.effect: c.confidence_alone for c in answer.candidates}
    alike = {c.effect: c.indistinguishable_from for c in answer.candidates if c.indistinguishable_from}
    return Diagnosed(answer.verdict or None, answer.missing, alone, alike, answer.unexplained_share)


def _effects(before: diagnose.Answer, after: diagnose.Answer, plan: Plan) -> list[TakenEffect]:
    """Return the effects in question with their probabilities, and what became of those whose answer changed."""
    old, new = ({c.effect: c for c in a.candidates} for a in (before, after))
    asked = {r.effect for r in plan.rivals if r.effect is not None}
    rows = []
    for name in dict.fromkeys([*new, *old]):
        was, now = (c[name].confidence_alone if name in c else None for c in (old, new))
        named = [name in a.missing for a in (before, after)]
        if name in asked or any(named) or max(was or 0.0, now or 0.0) >= MIN_SHOWN_PROBABILITY:
            change = None if named[0] == named[1] else "named" if named[1] else "refused"
            rows.append(TakenEffect(name, was, now, new[name].reason if name in new else None, change))
    return sorted(rows, key=lambda r: -(r.after or 0.0))


def _parameters(before: diagnose.Answer, after: diagnose.Answer) -> list[TakenParameter]:
    """Return the parameters of effects with their intervals, before and after."""
    old, new = ({f"{c.effect}.{n}": p for c in a.candidates for n, p in c.parameters.items()} for a in (before, after))
    shown = [n for n in new if n.partition(".")[0] in {*before.missing, *after.missing}]
    shown += [n for n in new if n in old and n not in shown]
    return [TakenParameter(name, old.get(name), new[name]) for name in shown]
