"""What ``init`` leaves to people: lines edited until ``ingest`` runs, and the checks that then speak.

``python -m benchmarks.front_door [DATA]``. Six exports that are written here, and the recordings of other laboratories
in the folder DATA, which ``PNEUCLI_DATA`` names elsewhere. A user edits what waits with a ``?``, and what is read
wrong; a line that is changed, added or taken out counts once.
"""

from __future__ import annotations

import difflib
import re
import sys
import tempfile
from collections import Counter
from collections.abc import Callable, Sequence
from pathlib import Path

from pneucli.config import load
from pneucli.pipeline.context import Context
from pneucli.stages import ingest, init
from tests.front_door import test_containers as containers
from tests.front_door.laboratory import write_workbook

Edit = tuple[str, str]  # a regular expression, and what stands in its place

# what a user knows of the rig that the exports were made of
RIG: list[Edit] = [
    (rf'^(\w.*)"\? {re.escape(unit)}"', rf'\1"{value} {unit}"')
    for unit, value in (("bar", 7), ("cm^2", 8.04), ("mm", 200), ("cm^3", 30), ("l", 0.16), ("V", 5))
]
_LINE = r"^{}.*\n"
VALVE_TEST = '\\1\nexperiment = "valve"\nuse = "train"\nu = "10 V"\nheader = false\n'
SETS: dict[str, tuple[str, list[Edit]]] = {
    "emps": ("emps", [(_LINE.format("force ="), 'force = { column = "vir", scale = 35.15065188, unit = "N" }\n')]),
    "zillen": ("zillen", [(r'^(\w.*)"\? cm\^2"', r'\1"4.909 cm^2"')]),
    "zillen/decay": ("zillen/decay", []),
    "hyddown": ("hyddown", [(r'valve = "shut".*', 'u = "-10 V"')]),
    "softbot": ("softbot", RIG),
    "enslyon, one file": (
        "enslyon/k2254Nm_v42.mat",
        [
            (_LINE.format("supply_pressure"), ""),
            (r"\[rig.vessel\]\n.*\n", ""),
            (_LINE.format("p1 ="), 'x = { expression = "42e-6 * `t` - 1.337e-4 * `Fnorm`", unit = "m" }\n'),
            (_LINE.format("# not taken"), 'force = { column = "Fnorm", scale = 0.3012, unit = "N" }\n'),
            (r'experiment = "valve"', 'experiment = "friction"'),
            (_LINE.format("u ="), 'imposed = "motion"\n'),
        ],
    ),
    "gtdynamics, filtered pressures": (
        "gtdynamics/*/*pres_filt.txt",
        [
            (_LINE.format("x ="), 'p_supply = { column = 2, unit = "kPa", reference = "gauge" }\n'),
            (_LINE.format("force ="), 'p1 = { column = 3, unit = "kPa", reference = "gauge" }\n'),
            (r'(file = .*)\nexperiment = "friction"\nuse = .*\nheader = false\nimposed.*\n', VALVE_TEST),
        ],
    ),
}


def excel(folder: Path) -> Path:
    """Write a workbook with a title, names, and units in a row of their own."""
    head: list[list[float | str]] = [["Axis 7, 21 March", "", "", ""], ["Zeit", "Ventil", "Druck 1", "Weg"]]
    rows = zip(containers.T, containers.U, containers.P, containers.X, strict=True)
    write_workbook(folder / "run.xlsx", [*head, ["s", "V", "bar", "mm"], *(list(map(float, row)) for row in rows)])
    return folder / "run.xlsx"


def messages(folder: Path) -> Path:
    """Write JSON lines as a robot's middleware logs them: stamps in two parts, and no units."""
    lines = []
    for t, u, p, x in zip(containers.T, containers.U, containers.P, containers.X, strict=True):
        secs, nsecs = divmod(round((1_711_026_307.123 + t) * 1e9), 10**9)
        stamp = f'"header": {{"stamp": {{"secs": {secs}, "nsecs": {nsecs}}}}}'
        lines.append(f'{{{stamp}, "valve": {u}, "p1": {1e5 * p:.1f}, "position": {1e-3 * x:.6f}}}')
    (folder / "run.jsonl").write_text("\n".join(lines) + "\n", encoding="utf-8")
    return folder / "run.jsonl"


EXPORTS: dict[str, Callable[[Path], Path]] = {
    "LabVIEW, TDMS waveforms": containers.tdms_waveforms,
    "Simulink, logged signals": containers.logged_signals,
    "MDF4, three rasters": containers.mdf_rasters,
    "TwinCAT scope, CSV": containers.twincat,
    "Excel, units in a row": excel,
    "ROS, JSON lines": messages,
}


def edited(text: str, edits: Sequence[Edit]) -> str:
    """Return a pipeline file as a user leaves it."""
    for pattern, replacement in edits:
        text = re.sub(pattern, replacement, text, flags=re.MULTILINE)
    return text


def edited_lines(before: str, after: str) -> int:
    """Return how many lines a user changed, added or took out."""
    matcher = difflib.SequenceMatcher(None, before.splitlines(), after.splitlines(), autojunk=False)
    return sum(max(b - a, d - c) for kind, a, b, c, d in matcher.get_opcodes() if kind != "equal")


def row(label: str, raw: Sequence[Path], edits: Sequence[Edit], folder: Path) -> str:
    """Return a row of the table: from raw files by ``init`` and edits to ``ingest``."""
    answer = init.create(folder / "p", raw)
    pipeline = folder / "p" / "pipeline.toml"
    before = pipeline.read_text(encoding="utf-8")
    after = edited(before, edits)
    pipeline.write_text(after, encoding="utf-8")
    (folder / "out").mkdir()
    read = ingest.run(Context(pipeline, load(pipeline), folder / "out", folder / "p"))
    checks = Counter(one["check"] for one in read["plausibility"])
    spoken = ", ".join(f"{check} {count}" for check, count in sorted(checks.items())) or "none"
    files = sum(one["files"] for one in answer["recordings"])
    counts = (files, len(answer["left_out"]), len(answer["check"]), edited_lines(before, after))
    return f"| {label} | {' | '.join(map(str, counts))} | {spoken} |"


def main(arguments: list[str]) -> None:
    """Print the table."""
    is_small = "--small" in arguments
    print("| input | files read | left out | lines with CHECK | lines edited | checks of ingest |")
    print("| --- | ---: | ---: | ---: | ---: | --- |")
    exports = list(EXPORTS.items())[3:4] if is_small else EXPORTS.items()
    with tempfile.TemporaryDirectory() as name:
        for number, (label, write) in enumerate(exports):
            folder = Path(name) / str(number)
            folder.mkdir()
            print(row(label, [write(folder)], RIG, folder), flush=True)
        for number, (label, (where, edits)) in enumerate(SETS.items() if arguments and not is_small else ()):
            folder = Path(name) / f"set-{number}"
            folder.mkdir()
            print(row(label, [Path(arguments[0]) / where], edits, folder), flush=True)


if __name__ == "__main__":
    main(sys.argv[1:])
