"""How good are the answers, and are they still as good? ``python -m benchmarks.score [WORLD...]``, or ``make score``.

Every command with ``--json`` is asked of the fixtures, of a small sealed exam and, where the folder of shared cases is
at hand (``PNEUCLI_SHARED``, else ``shared`` beside the repository), of all that is in it: a sample of each world, or
all with ``--full``. What matters of each answer is compared with the stored one in ``benchmarks/scores/WORLD.jsonl``,
one line a command of a case. Printed are all changes, better or worse against the truth where it is known, then counts
by world with processor seconds and peak memory, medians a case. The exit code is 1 where an answer is worse and
``benchmarks/scores/accepted.toml`` has no line that says why.

    python -m benchmarks.score --program ROOT   answers of the program in another folder, or of another interpreter
    python -m benchmarks.score --only-kept      judges what an interrupted run has answered
    python -m benchmarks.score --write          stores the answers; reasons in accepted.toml move beside the answers

Answers are kept below ``build/score`` by the digest of the program; an interrupted run goes on where it stopped.
"""

from __future__ import annotations

import argparse
import hashlib
import json
import math
import os
import re
import resource
import shutil
import statistics
import subprocess
import sys
import tempfile
import threading
import tomllib
from collections import Counter
from collections.abc import Iterable, Iterator, Mapping, Sequence, Set
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from fnmatch import fnmatchcase
from itertools import pairwise
from pathlib import Path
from signal import SIGHUP, SIGTERM
from typing import Any

from benchmarks.cases import (
    DOUBTFUL,
    ROOT,
    Case,
    Counts,
    Truth,
    World,
    is_fault,
    is_refused,
    judged,
    own_program,
    reading_faults,
    sampled,
    shared_folder,
    source_digest,
    worlds,
)

COST = ("seconds", "MB")
SETS = "sets.parquet"
DONE = "done.json"  # beside the answers of a case that has been asked all
MAX_SECONDS = 1800  # of processor time for a command; a rig that takes longer has no answer
MAX_WAIT = 6 * MAX_SECONDS  # of a command that may hang without using the processor
ASKED_TO_END = {-SIGTERM, -SIGHUP}
DIGITS = 4
READINGS = ("p1", "p2", "p_supply", "u", "x", "v", "force", "flow")  # signals whose range is kept
Row = dict[str, Any]
Rows = Mapping[str, Row]  # of a case, by command


def ask(case: Case, python: str, kept: Path) -> list[Row]:
    """Return the rows of a case, a command each, from the kept answers or else from the program.

    The answers of a case are asked for together, because a command spares what an earlier one has made.
    """
    folder = kept / case.world / case.name
    if not is_kept(case, kept):
        folder.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryDirectory() as name:
            found = [row for command in case.commands if (row := _asked(case, command, python, Path(name), folder))]
        text = json.dumps({"inputs": digest_of_inputs(case), "answers": found})
        (folder / DONE).write_text(text, encoding="utf-8")
    return [_row(folder, one) for one in json.loads((folder / DONE).read_text(encoding="utf-8"))["answers"]]


def is_kept(case: Case, kept: Path) -> bool:
    """Whether the answers of a case are kept, to just what would be asked now."""
    done = kept / case.world / case.name / DONE
    return done.is_file() and json.loads(done.read_text(encoding="utf-8"))["inputs"] == digest_of_inputs(case)


def digest_of_inputs(case: Case) -> str:
    """Return a digest of what is asked of a case: commands, edits, the pipeline file, names and sizes of the others."""
    files = case.raw if case.pipeline is None else sorted(case.pipeline.parent.rglob("*"))
    listed = [(path.name, path.stat().st_size) for path in files if path.is_file()]
    text = case.pipeline.read_text(encoding="utf-8") if case.pipeline else ""
    return hashlib.sha256(repr((case.commands, case.edits, text, listed)).encode()).hexdigest()[:12]


def _row(folder: Path, asked: Row) -> Row:
    """Return a row: the command, what matters of its answer, and last what it cost."""
    text = (folder / f"{asked['command']}.json").read_text(encoding="utf-8")
    cost = {name: asked.pop(name) for name in COST}
    return {**asked, **essence(asked["command"], text), **cost}


def _asked(case: Case, command: str, python: str, scratch: Path, folder: Path) -> Row | None:
    """Ask for one command and keep its answer; return the rest. None: ``init`` left nothing to go on with."""
    pipeline, out = case.pipeline or scratch / "door" / "pipeline.toml", scratch / "out"
    program = [*own_program(python), command]
    if command == "init":
        words = [str(pipeline.parent), "--from", *map(str, case.raw)]
    elif pipeline.is_file():
        words = [str(pipeline), "--out", str(out), *(["--to", "c"] if command == "export" else [])]
    else:
        return None
    code, text, seconds, memory = measured([*program, *words, "--json", "--quiet"])
    (folder / f"{command}.json").write_text(text, encoding="utf-8")
    row: Row = {"case": case.name, "command": command, "exit": code}
    if command == "diagnose" and (sets := out / "diagnose" / SETS).is_file():
        shutil.copy(sets, folder)  # for benchmarks.evidence
    if command in ("compare", "diagnose") and code in (0, 1):  # a second time, from the kept stage: takes no time
        row["do"] = next_command(measured([*program, *words, "--quiet"])[1])
    if command == "report" and (page := out / "report" / "report.html").is_file():
        row["tiles"] = tiles(page.read_text(encoding="utf-8"))
    if command == "init" and pipeline.is_file():
        row["edits"] = _edit(pipeline, case)
    return {**row, "seconds": round(seconds, 1), "MB": round(memory)}


def measured(words: Sequence[str]) -> tuple[int, str, float, float]:
    """Run a command alone on its core; return exit code, standard output, processor seconds and peak memory (MB).

    A command that a signal ends, or that takes too long, has the negative number of the signal as its code; one that
    somebody asked to end is run again.
    """
    found = _measured(words)
    return found if found[0] not in ASKED_TO_END else measured(words)


def _measured(words: Sequence[str]) -> tuple[int, str, float, float]:
    environment = {
        **os.environ,
        **dict.fromkeys(("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "NUMBA_NUM_THREADS", "PNEUCLI_THREADS"), "1"),
        "PNEUCLI_DATA": os.environ.get("PNEUCLI_DATA") or str(shared_folder() / "real"),
        "PYTHONDONTWRITEBYTECODE": "",  # as installed, the program's byte code is on disk
    }
    with tempfile.TemporaryFile() as out, tempfile.TemporaryFile() as messages:
        child = subprocess.Popen(words, stdout=out, stderr=messages, stdin=subprocess.DEVNULL, env=environment)
        resource.prlimit(child.pid, resource.RLIMIT_CPU, (MAX_SECONDS, MAX_SECONDS))
        timer = threading.Timer(MAX_WAIT, child.kill)
        timer.start()
        _, status, used = os.wait4(child.pid, 0)
        timer.cancel()
        child.returncode = os.waitstatus_to_exitcode(status)  # Popen does not see that it was waited for
        out.seek(0)
        text = out.read().decode("utf-8", "replace")
    return child.returncode, text, used.ru_utime + used.ru_stime, used.ru_maxrss / 1024


def _edit(pipeline: Path, case: Case) -> int:
    """Put in what a user knows of the rig; return the number of lines that are no longer as ``init`` wrote them."""
    before = text = pipeline.read_text(encoding="utf-8")
    for pattern, replacement in case.edits:
        text = re.sub(pattern, replacement, text, flags=re.MULTILINE)
    pipeline.write_text(text, encoding="utf-8")
    kept = Counter(before.splitlines()) & Counter(text.splitlines())
    return max(len(before.splitlines()), len(text.splitlines())) - kept.total()


def next_command(said: str) -> str:
    """Return the command that an answer proposes next ("" where it proposes none)."""
    found = re.search(r"^do (?:.*\n {9})*?.*?\bpneucli (\w+)", said, re.MULTILINE)
    return found[1] if found else ""


def tiles(page: str) -> dict[str, str]:
    """Return the colour (good, bad or none) of each tile of a report."""
    return {title: colour or "none" for colour, title in re.findall(r'class="tile ?(\w*)"><h2>([^<]*)', page)}


def essence(command: str, text: str) -> Row:
    """Return what matters of an answer; of a refusal the code of its error."""
    try:
        answer = json.loads(text)
    except json.JSONDecodeError:
        return {}
    if "error" in answer and "exit_code" in answer:
        return {"refused": [answer["error"].get("code", "")]}
    reduce = {
        "init": _of_init,
        "ingest": _of_ingest,
        "identify": lambda a: {"parameters": _parameters(a["model"]["parameters"])},
        "compare": _of_compare,
        "diagnose": _of_diagnose,
    }.get(command, _figures)
    return reduce(answer)


def _of_init(answer: Mapping[str, Any]) -> Row:
    taken = {
        one["signal"]: f"{one['unit']}{' gauge' if one['gauge'] else ''}" for one in answer["columns"] if one["signal"]
    }
    return {"takes": taken, "check": len(answer["check"]), "asks": len(answer["fill_in"])}


def _of_ingest(answer: Mapping[str, Any]) -> Row:
    looks = [look for signals in answer["looks"].values() for look in signals.items()]
    reads, noise, rate = {}, {}, {}
    for signal in READINGS:
        if mine := [look for name, look in looks if name == signal]:
            reads[signal] = [rounded(min(o["least"] for o in mine)), rounded(max(o["most"] for o in mine))]
            noise[signal] = rounded(max((o["noise"] for o in mine if o["noise"] is not None), default=None), 2)
            rate[signal] = rounded(min((o["rate"] for o in mine if o["rate"] is not None), default=None))
    samples = sum(one["samples"] for one in answer["recordings"])
    return {"doubts": _checks(answer), "samples": samples, "reads": reads, "noise": noise, "rate": rate}


def _of_compare(answer: Mapping[str, Any]) -> Row:
    return {"error": [rounded(answer["error"][use]) for use in ("train", "test")], **_judgement(answer)}


def _of_diagnose(answer: Mapping[str, Any]) -> Row:
    named = {c["effect"]: c for c in answer["candidates"] if c["effect"] in answer["missing"]}
    ladder = answer["ladder"]
    row = {
        "verdict": answer["verdict"],
        "missing": answer["missing"],
        "twins": {n: c["indistinguishable_from"] for n, c in named.items() if c["indistinguishable_from"]},
        "confidence": {name: rounded(c.get("confidence"), 2) for name, c in named.items()},
        "path": [[rounded(step["error_train"]), rounded(step["error_test"])] for step in ladder],
        "refused": sorted(_refusing_checks(answer)),
        "parameters": {
            f"{name}.{parameter}": value
            for name, c in named.items()
            for parameter, value in _parameters(c["parameters"]).items()
        },
    }
    return {**row, **_judgement(answer)}


def _judgement(answer: Mapping[str, Any]) -> Row:
    """Return the limit of the printed error (train, test), and whether the error exceeds what noise explains.

    An older program states limits alone.
    """
    limits = answer.get("error_limit") or {}
    found = answer.get("lack_of_fit")
    if found:
        limits = {found["use"]: found["limit"]}
    row: Row = {"limit": [rounded(limits.get(use)) for use in ("train", "test")]}
    return {**row, "lack_of_fit": bool(found["present"])} if found else row


def _refusing_checks(answer: Mapping[str, Any]) -> set[str]:
    """Return the checks for which nothing was named: contradictions, or all where an older program has no weights."""
    if answer["verdict"] != "inconclusive" or not answer.get("impossible"):
        return set()
    found = answer["plausibility"]
    return {one["check"] for one in found if one.get("weight", "contradiction") == "contradiction"}


def _checks(answer: Mapping[str, Any]) -> dict[str, int]:
    return dict(sorted(Counter(one["check"] for one in answer["plausibility"]).items()))


def _parameters(found: Mapping[str, Any]) -> dict[str, list[float | None]]:
    """Return value and interval of each parameter but the areas of single commands, of which there are many."""
    return {
        name: [rounded(one["value"]), *(rounded(end) for end in (one["ci95"] or (None, None)))]
        for name, one in found.items()
        if not name.startswith("valve.effective_area")
    }


def _figures(answer: Mapping[str, Any]) -> Row:
    """Return the numbers and truths that stand in an answer by themselves, and how long its lists are."""
    plain = {k: rounded(v) for k, v in answer.items() if isinstance(v, int | float) and k != "seconds"}
    return {"figures": {**plain, **{k: len(v) for k, v in answer.items() if isinstance(v, list)}}}


def rounded(value: float | None, digits: int = DIGITS) -> float | None:
    """Return a number with few digits; None where there is none, or none that JSON knows."""
    return None if value is None or not math.isfinite(value) else float(f"{value:.{digits}g}")


ERROR_TOLERANCE, LEAST_CHANGE = 0.05, 0.02  # of an error over noise: of its size, and absolute
ROUNDING = 1e-3  # of kept numbers
GOOD = ("found", "right", "silent", "close", "covered")  # counts of which more is better
BAD = ("false",)  # counts of which fewer are better
NEITHER = ("exact", "mild")  # a mild name, or an equivalent one in place of the hidden one


@dataclass(frozen=True)
class Change:
    """One difference between a stored answer and a new one; ``worse`` is None where nobody can tell."""

    command: str
    worse: bool | None
    text: str


def contradictions(rows: Rows) -> list[str]:
    """Return in which ways the answers to a case contradict each other or themselves, in words.

    One judgement decides: the error stands within its limit or not. Verdict, missing effects, test of the lack of fit,
    next command and tiles have to agree with it, an added effect may not raise the error, and two commands print one
    number.
    """
    compare, diagnose, report = (rows.get(name, {}) for name in ("compare", "diagnose", "report"))
    out = []
    adequate = diagnose.get("verdict") == "adequate"
    within = is_within_limit(compare)
    path = [judging(pair) for pair in diagnose.get("path", [])]
    own_limit = judging(diagnose.get("limit", (None, None)))
    if adequate and diagnose["missing"]:
        out.append("adequate, and effects are missing")
    if adequate and diagnose.get("lack_of_fit"):
        out.append("adequate, and a lack of fit is present")
    if adequate and (within is False or (path and exceeds(path[-1], own_limit))):
        out.append("adequate, and the error is beyond its limit")
    if adequate and diagnose.get("do") == "diagnose":
        out.append("adequate, and proposes to diagnose")
    if diagnose.get("verdict") == "missing-effect" and not diagnose["missing"]:
        out.append("an effect is missing, and none is named")
    if diagnose.get("verdict") == "missing-effect" and diagnose.get("lack_of_fit"):
        out.append("an effect is all that is missing, and a lack of fit is present")
    if diagnose.get("verdict") == "unexplained" and diagnose.get("lack_of_fit") is False:
        out.append("something is unexplained, and no lack of fit is present")
    if within and compare.get("do") == "diagnose":
        out.append("compare stands within the limit, and proposes to diagnose")
    if any(b > a * (1 + ERROR_TOLERANCE) for a, b in pairwise(path) if a is not None and b is not None):
        out.append("an added effect raises the error")
    if within is not None and path and differs(judging(compare["error"]), path[0]):  # a flow bench has two models
        out.append("compare and diagnose print two errors of one model")
    if "tiles" in report and within is not None and (report["tiles"].get("The model") == "good") != within:
        out.append("the tile of the model does not say what its limit says")
    return out


def judging(pair: Sequence[float | None]) -> float | None:
    """Return the error that judges a model: of test recordings, or of those that were fitted where there are none."""
    train, test = pair
    return train if test is None else test


def exceeds(error: float | None, limit: float | None) -> bool:
    """Whether a printed error is beyond the limit that stands beside it, by more than rounding."""
    return error is not None and limit is not None and error > limit * (1 + ROUNDING)


def is_within_limit(compare: Row) -> bool | None:
    """Whether the answer judges its model to be right: nothing of it is beyond a limit; None where it does not say."""
    if "error" not in compare:
        return None
    error, limit = judging(compare["error"]), judging(compare["limit"])
    return None if error is None or limit is None else not exceeds(error, limit) and not compare.get("lack_of_fit")


def differs(a: float | None, b: float | None) -> bool:
    """Whether two errors differ by more than the tolerance."""
    if a is None or b is None:
        return a is not b
    return abs(a - b) > LEAST_CHANGE + ERROR_TOLERANCE * min(abs(a), abs(b))


def compared(truth: Truth, old: Rows, new: Rows, *, is_sound: bool) -> list[Change]:
    """Return the changes of a case from the stored rows to the new ones, by command.

    Args:
        truth: What is true of the case.
        old: The stored rows by command.
        new: The new rows by command.
        is_sound: Whether nothing is wrong with the recordings, so that every doubt is a false alarm.

    """
    if not old:
        return [Change(", ".join(new), None, "no answer is stored")]
    out = []
    for command in [*new, *(name for name in old if name not in new)]:
        before, after = old.get(command), new.get(command)
        if before is None or after is None:
            out.append(Change(command, None, "was not asked" if before is None else "is no longer asked"))
        else:
            out += _of_exit(truth, before, after)
            if is_answer(after) and command == "diagnose":
                out += _of_counts(truth, before, after)
            if is_answer(before) and is_answer(after):
                out += _of_answer(truth, before, after, is_sound=is_sound)
    return [*out, *_of_reading(truth, old, new), *_of_contradictions(old, new)]


def is_answer(row: Row) -> bool:
    """Whether a row holds an answer: neither a refusal nor a fault."""
    return not is_refused(row) and not is_fault(row)


def _of_exit(truth: Truth, before: Row, after: Row) -> Iterator[Change]:
    command = after["command"]
    if is_fault(before) != is_fault(after):
        yield Change(command, is_fault(after), f"exit {before['exit']} -> {after['exit']}")
    elif is_refused(before) != is_refused(after):
        reasons = ", ".join((after if is_refused(after) else before).get("refused", []))
        worse = None if truth.may_refuse else is_refused(after)
        yield Change(command, worse, f"{'refused' if is_refused(after) else 'no longer refused'} ({reasons})")
    elif before["exit"] != after["exit"] or before.get("refused") != after.get("refused"):
        text = f"exit {before['exit']} {before.get('refused')} -> {after['exit']} {after.get('refused')}"
        yield Change(command, None, text)


def _of_answer(truth: Truth, before: Row, after: Row, *, is_sound: bool) -> Iterator[Change]:
    command = after["command"]
    if command == "init":
        if before["edits"] != after["edits"]:
            worse = after["edits"] > before["edits"]
            yield Change(command, worse, f"lines to edit {before['edits']} -> {after['edits']}")
        if before["takes"] != after["takes"]:
            yield Change(command, None, f"takes {before['takes']} -> {after['takes']}")
    elif command == "ingest" and before["doubts"] != after["doubts"]:
        came, went = after["doubts"].keys() - before["doubts"].keys(), before["doubts"].keys() - after["doubts"].keys()
        worse = bool(came) if is_sound and (came or went) else None
        yield Change(command, worse, f"doubts {before['doubts'] or 'none'} -> {after['doubts'] or 'none'}")
    elif command == "identify":
        yield from _of_intervals(command, before["parameters"], after["parameters"])
    elif command == "compare":
        yield from _of_error(command, judging(before["error"]), judging(after["error"]), matters=not truth.hidden)
    elif command == "diagnose":
        if before["verdict"] != after["verdict"]:
            yield Change(command, None, f"{before['verdict']} -> {after['verdict']}")
        if set(before["missing"]) == set(after["missing"]):
            yield from _of_error(command, judging(before["path"][-1]), judging(after["path"][-1]), matters=True)
            yield from _of_intervals(command, before["parameters"], after["parameters"])
    if before.get("figures") != after.get("figures"):
        yield Change(command, None, f"{before.get('figures')} -> {after.get('figures')}")


def _of_counts(truth: Truth, before: Row, after: Row) -> Iterator[Change]:
    """Yield how the names of a diagnosis became better or worse; an answer that was refused had none."""
    was, now, out = judged(truth, before), judged(truth, after), []
    for name in (*GOOD, *BAD, *NEITHER):
        a, b = getattr(was, name), getattr(now, name)
        if a != b and (name not in ("close", "covered") or was.parameters == now.parameters):
            worse = None if name in NEITHER else (b < a) == (name in GOOD)
            out.append(Change("diagnose", worse, f"{name} {a} -> {b}{_names(before, after)}"))
    if not out and _names(before, after):
        out.append(Change("diagnose", None, f"names{_names(before, after)}"))
    yield from out


def _names(before: Row, after: Row) -> str:
    was, now = before.get("missing", []), after["missing"]
    return "" if set(was) == set(now) else f": {', '.join(was) or 'nothing'} -> {', '.join(now) or 'nothing'}"


def _of_error(command: str, before: float | None, after: float | None, *, matters: bool) -> Iterator[Change]:
    """Yield the change of an error; that of a model that lacks an effect does not matter."""
    if differs(before, after):
        worse = after > before if matters and before is not None and after is not None else None
        yield Change(command, worse, f"error {before} -> {after}")


def _of_intervals(command: str, before: Row, after: Row) -> Iterator[Change]:
    """Yield a change for each parameter whose new value is outside the stored interval and the other way round."""
    for name in before.keys() & after.keys():
        (a, low_a, high_a), (b, low_b, high_b) = before[name], after[name]
        if None in (a, low_a, high_a, b, low_b, high_b):
            continue
        if not low_a <= b <= high_a and not low_b <= a <= high_b and abs(a - b) > ERROR_TOLERANCE * abs(a):
            yield Change(command, None, f"{name} {a:g} -> {b:g}")


def _of_reading(truth: Truth, old: Rows, new: Rows) -> Iterator[Change]:
    was, now = reading_faults(truth, old), reading_faults(truth, new)
    if len(was) != len(now):
        yield Change("ingest", len(now) > len(was), f"read wrongly: {'; '.join(was) or '-'} -> {'; '.join(now) or '-'}")


def _of_contradictions(old: Rows, new: Rows) -> Iterator[Change]:
    was, now = contradictions(old), contradictions(new)
    yield from (Change("diagnose", True, f"contradiction: {one}") for one in now if one not in was)
    yield from (Change("diagnose", False, f"no longer a contradiction: {one}") for one in was if one not in now)


SCORES = ROOT / "benchmarks" / "scores"
ACCEPTED = SCORES / "accepted.toml"
KEPT = ROOT / "build" / "score"


def stored(world: str) -> dict[str, dict[str, Row]]:
    """Return the stored rows of a world by case and command."""
    path, out = SCORES / f"{world}.jsonl", {}
    if path.is_file():
        for line in path.read_text(encoding="utf-8").splitlines():
            row = json.loads(line)
            out.setdefault(row["case"], {})[row["command"]] = row
    return out


def store(world: str, cases: Mapping[str, Rows], why: Mapping[str, str]) -> None:
    """Put the rows of some cases in place of the stored ones.

    Args:
        world: The name of the world.
        cases: The new rows by case and command.
        why: The reason for each case of which an answer became worse; it is stored with the rows that changed.

    """
    known = stored(world)
    for name, rows in cases.items():
        before = known.get(name, {})
        known[name] = {
            command: {**row, **_reason(before.get(command, {}), row, why.get(name, ""))}
            for command, row in rows.items()
        }
    lines = [json.dumps(row, ensure_ascii=False) for _, rows in sorted(known.items()) for row in rows.values()]
    (SCORES / f"{world}.jsonl").write_text("\n".join(lines) + "\n", encoding="utf-8")


def _reason(before: Row, after: Row, why: str) -> dict[str, str]:
    same = {k: v for k, v in before.items() if k not in (*COST, "why")} == {
        k: v for k, v in after.items() if k not in COST
    }
    text = before.get("why", "") if same else why
    return {"why": text} if text else {}


def reasons() -> dict[str, str]:
    """Return why worse answers are accepted: a reason for each pattern of WORLD/CASE."""
    return tomllib.loads(ACCEPTED.read_text(encoding="utf-8")) if ACCEPTED.is_file() else {}


def reason_of(key: str, accepted: Mapping[str, str]) -> str:
    """Return the reason for which a worse answer to WORLD/CASE is accepted, "" where there is none."""
    return next((why for pattern, why in accepted.items() if fnmatchcase(key, pattern)), "")


def drop_reasons(used: Set[str]) -> None:
    """Take out of ``accepted.toml`` the reasons that now stand beside their answers: they excuse nothing else."""
    lines = ACCEPTED.read_text(encoding="utf-8").splitlines() if ACCEPTED.is_file() else []
    kept = [line for line in lines if not set(tomllib.loads(line).values()) & used]
    ACCEPTED.write_text("".join(f"{line}\n" for line in kept), encoding="utf-8")


@dataclass
class Tally:
    """The counts of a world's cases, the cases that contradict themselves or are read wrongly, and the costs."""

    counts: Counts
    contradicting: int
    doors: int
    misread: int
    seconds: list[float]
    memory: list[float]

    @classmethod
    def of(cls, cases: Iterable[tuple[Case, Rows]]) -> Tally:
        """Count the answers to some cases."""
        out = cls(Counts(), 0, 0, 0, [], [])
        for case, rows in cases:
            failed = any(is_fault(one) for one in rows.values())
            if row := rows.get("diagnose"):
                out.counts += judged(case.truth, row)
                out.counts += Counts(faults=int(failed and not is_fault(row)))
            else:
                refused = any(is_refused(one) for one in rows.values())
                answered = int(not failed and not refused)
                out.counts += Counts(cases=1, answered=answered, refused=int(refused), faults=int(failed))
            out.contradicting += bool(contradictions(rows))
            out.doors += case.truth.is_about_reading
            out.misread += bool(case.truth.is_about_reading and reading_faults(case.truth, rows))
            out.seconds.append(sum(row["seconds"] for row in rows.values()))
            out.memory.append(max(row["MB"] for row in rows.values()))
        return out

    def cells(self) -> list[str]:
        """Return the cells of a table's row."""
        c = self.counts
        return [
            f"{c.answered}/{c.cases}",
            f"{c.found}/{c.effects}",
            f"{c.right}/{c.known}",
            f"{c.exact}/{c.known}",
            str(c.false),
            str(c.mild),
            f"{c.silent}/{c.healthy}",
            f"{c.close}/{c.parameters}",
            f"{c.covered}/{c.parameters}",
            f"{self.doors - self.misread}/{self.doors}",
            str(c.refused),
            str(c.faults),
            str(self.contradicting),
            f"{statistics.median(self.seconds):.0f}",
            f"{statistics.median(self.memory):.0f}",
        ]


HEADER = (
    "world",
    "answered",
    "effects in answer",
    "right",
    "exactly",
    "false",
    "mild",
    "healthy silent",
    "within 15 %",
    "interval holds",
    "read rightly",
    "refused",
    "faults",
    "contradict themselves",
    "s",
    "MB",
)


def table(tallies: Mapping[str, tuple[Tally | None, Tally]]) -> Iterator[str]:
    """Yield the lines of the table: a row a world, a cell that has changed as stored -> now."""
    yield f"| {' | '.join(HEADER)} |"
    yield f"|{' --- |' * len(HEADER)}"
    for name, (before, after) in tallies.items():
        old = before.cells() if before else after.cells()
        cells = [b if a == b else f"{a} -> {b}" for a, b in zip(old, after.cells(), strict=True)]
        yield f"| {' | '.join([name, *cells])} |"


def answered(asked: Sequence[Case], python: str, kept: Path, jobs: int) -> Iterator[tuple[Case, Rows]]:
    """Yield each case with its rows, ``jobs`` cases at once; tell on standard error how far it is."""
    with ThreadPoolExecutor(jobs) as pool:
        futures = [(case, pool.submit(ask, case, python, kept)) for case in asked]
        for number, (case, future) in enumerate(futures, 1):
            rows = {row["command"]: row for row in future.result()}
            spent = sum(row["seconds"] for row in rows.values())
            said = f"{number}/{len(asked)} {case.world}/{case.name} {spent:.0f} s"
            print(said, file=sys.stderr, flush=True)
            yield case, rows


def interpreter(program: Path | None) -> str:
    """Return the interpreter of a program: this one, that of a folder's own environment, or the one that is named."""
    if program is None:
        return sys.executable
    return str(program / ".venv" / "bin" / "python" if program.is_dir() else program)


def package(python: str) -> Path:
    """Return the folder of the package that an interpreter would run."""
    asked = [python, "-P", "-c", "import pneucli; print(pneucli.__path__[0])"]
    return Path(subprocess.run(asked, check=True, capture_output=True, text=True).stdout.strip())


def parsed(arguments: Sequence[str]) -> argparse.Namespace:
    """Return what the command line asks for."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.score")
    parser.add_argument("worlds", nargs="*", help="worlds, all if none is named")
    parser.add_argument("--full", action="store_true", help="all cases, not a sample of each world")
    parser.add_argument("--program", type=Path, help="a folder with .venv, or an interpreter")
    parser.add_argument("--jobs", type=int, default=2, help="cases at once")
    parser.add_argument("--kept", type=Path, default=KEPT, help="where answers are kept")
    parser.add_argument("--only-kept", action="store_true", help="ask for nothing, judge what is kept")
    parser.add_argument("--write", action="store_true", help="store the answers")
    parser.add_argument("--small", action="store_true", help="one fixture")
    return parser.parse_args(list(arguments))


def main(arguments: Sequence[str]) -> int:
    """Ask, compare, print; return the exit code."""
    asked = parsed(arguments)
    python = interpreter(asked.program)
    code = package(python)
    at_hand = worlds(python, asked.kept / f"exam-{source_digest(code / 'exam')}", full=asked.full)
    if asked.small:
        at_hand = [World("fixtures", 1, at_hand[0].cases)]
    elif not shared_folder().is_dir():
        print(f"{shared_folder()} is not there: the score is of fixtures and exam alone", file=sys.stderr)
    if unknown := sorted(set(asked.worlds) - {world.name for world in at_hand}):
        print(f"no world {', '.join(unknown)}; there are {', '.join(w.name for w in at_hand)}", file=sys.stderr)
        return 2
    chosen = [world for world in at_hand if not asked.worlds or world.name in asked.worlds]
    cases = [one for w in chosen for one in (w.cases() if asked.full else sampled(w.cases(), w.sample))]
    kept = asked.kept / source_digest(code)
    if asked.only_kept:
        cases = [one for one in cases if is_kept(one, kept)]
    results: dict[str, list[tuple[Case, Rows]]] = {world.name: [] for world in chosen}
    for case, rows in answered(cases, python, kept, asked.jobs):
        results[case.world].append((case, rows))
    return judge({world: answers for world, answers in results.items() if answers}, write=asked.write)


def judge(results: Mapping[str, Sequence[tuple[Case, Rows]]], *, write: bool) -> int:
    """Print what has changed and the counts of each world; return 1 where something is worse without a reason.

    With ``write`` the new answers are stored unless that is so.
    """
    accepted, reasoned, said, tallies = reasons(), {}, [], {}
    for world, answers in results.items():
        known = stored(world)
        old = [(case, known[case.name]) for case, _ in answers if case.name in known]
        tallies[world] = (Tally.of(old) if len(old) == len(answers) else None, Tally.of(answers))
        for case, rows in answers:
            key, before = f"{world}/{case.name}", known.get(case.name, {})
            changes = compared(case.truth, before, rows, is_sound=world not in DOUBTFUL)
            said += [(one.worse, f"{key} {one.command}: {one.text}") for one in changes]
            if any(one.worse for one in changes):
                reasoned[key] = reason_of(key, accepted)
                said.append((True, f"{key} is accepted: {reasoned[key]}" if reasoned[key] else f"{key} needs a reason"))
    for kind, title in ((True, "worse"), (False, "better"), (None, "changed")):
        print("".join(f"{title:8s} {text}\n" for worse, text in said if worse is kind), end="")
    print("\n".join(table(tallies)))
    for case, rows in (one for answers in results.values() for one in answers):
        print("".join(f"{case.world}/{case.name} contradicts itself: {one}\n" for one in contradictions(rows)), end="")
    if not all(reasoned.values()):
        return 1
    if write:
        for world, answers in results.items():
            why = {case.name: reasoned.get(f"{world}/{case.name}", "") for case, _ in answers}
            store(world, {case.name: rows for case, rows in answers}, why)
        drop_reasons(set(reasoned.values()))
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
