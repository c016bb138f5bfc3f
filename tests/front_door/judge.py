"""What became of a recording at the front door: right, marked, told, or refused; or wrong in silence."""

import re
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pyarrow.parquet as pq

from pneucli.arrays import Array
from pneucli.config import load
from pneucli.errors import InputError
from pneucli.pipeline.graph import Context
from pneucli.stages import ingest, init

from .laboratory import NOISE, RATE, TRUTH

FILL_IN = {
    '"? V"': '"5 V"', '"? bar"': '"7 bar"', '"? l"': '"0.16 l"', '"? cm^2"': '"8.04 cm^2"', '"? mm"': '"200 mm"',
    '"? cm^3"': '"30 cm^3"', 'scale = "?"': "scale = 0.01", "row / ?": "row / 1000",
}  # fmt: skip


@dataclass
class Outcome:
    """``verdict`` of each signal, and why."""

    verdicts: dict[str, str]
    why: str = ""

    @property
    def verdict(self) -> str:
        """The worst of the signals'."""
        order = ("wrong in silence", "refused", "marked", "told", "right")
        return min(self.verdicts.values(), key=order.index)


def judge(path: Path, folder: Path, base: float) -> Outcome:
    """Send a file through ``init`` and ``ingest``, and hold what comes out against the truth."""
    try:
        init.create(folder / "p", [path])
        pipeline = folder / "p" / "pipeline.toml"
        text = pipeline.read_text(encoding="utf-8")
        for mark, value in FILL_IN.items():
            text = text.replace(mark, value)
        text = re.sub(r'(\ntime = .*unit = )"\?"', r'\1"ms"', text)  # the one kind whose clock says no unit
        pipeline.write_text(text, encoding="utf-8")
        (folder / "out").mkdir(parents=True)
        answer = ingest.run(Context(pipeline, load(pipeline), folder / "out", folder))
    except InputError as error:
        return Outcome({"all": "refused"}, str(error).splitlines()[0])
    signals = pq.read_table(folder / "out" / "signals.parquet").to_pydict()
    lines = {line.split(" = ", 1)[0]: line for line in text.splitlines() if " = { " in line}
    doubted = {name for name, line in lines.items() if "CHECK" in line}
    told = {repair["signal"] for repair in answer["repairs"]} | {one["signal"] for one in answer["plausibility"]}
    time = np.array(signals["time"], dtype=float) - base
    return Outcome({name: _verdict(name, signals, time, doubted, told) for name in TRUTH}, text)


def _verdict(name: str, signals: dict[str, list[float]], time: Array, doubted: set[str], told: set[str]) -> str:
    if name not in signals:
        return "marked"  # not taken: init lists it
    values = np.array([np.nan if value is None else value for value in signals[name]], dtype=float)
    if _agrees(name, time, values):
        return "right"
    if doubted & {name, "time"}:
        return "marked"
    return "told" if told & {name, "time"} else "wrong in silence"


def _agrees(name: str, time: Array, values: Array) -> bool:
    known = np.isfinite(values)
    near = np.stack([TRUTH[name](time[known] + shift) for shift in (-1.0 / RATE, 0.0, 1.0 / RATE)])
    slack = 8 * NOISE[name] + {"u": 1e-6, "p1": 20.0, "x": 2e-5}[name]
    inside = (values[known] >= near.min(axis=0) - slack) & (values[known] <= near.max(axis=0) + slack)
    return bool(known.sum() > 50 and inside.mean() > 0.995)
