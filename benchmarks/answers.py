"""Answers of the program to the cases of ``benchmarks.score``: asked for, kept, and reduced to what matters of them."""

from __future__ import annotations

import hashlib
import json
import math
import os
import re
import resource
import shutil
import subprocess
import tempfile
import threading
from collections import Counter
from collections.abc import Mapping, Sequence
from pathlib import Path
from signal import SIGHUP, SIGTERM
from typing import Any

from benchmarks.worlds import Case, own_program, shared_folder

COST = ("seconds", "MB")
SETS = "sets.parquet"
DONE = "done.json"  # beside the answers of a case that has been asked all
MAX_SECONDS = 1800  # of processor time for a command; a rig that takes longer has no answer
MAX_WAIT = 6 * MAX_SECONDS  # of a command that may hang without using the processor
ASKED_TO_END = {-SIGTERM, -SIGHUP}
DIGITS = 4
READINGS = ("p1", "p2", "p_supply", "u", "x", "v", "force", "flow")  # signals whose range is kept
Row = dict[str, Any]


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
