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
import json
import statistics
import subprocess
import sys
import tomllib
from collections.abc import Iterable, Iterator, Mapping, Sequence, Set
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from fnmatch import fnmatchcase
from pathlib import Path

from benchmarks.answers import COST, ask, is_kept
from benchmarks.regressions import Row, Rows, compared, contradictions
from benchmarks.truths import Counts, is_fault, is_refused, judged, reading_faults
from benchmarks.worlds import DOUBTFUL, ROOT, Case, World, sampled, shared_folder, source_digest, worlds

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
            if row := rows.get("diagnose"):
                out.counts += judged(case.truth, row)
            else:
                failed = any(is_fault(one) for one in rows.values())
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
