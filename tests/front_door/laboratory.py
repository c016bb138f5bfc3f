"""Recordings as laboratories write them: one known axis, in a random clock, unit, container, and with random faults."""

import bz2
import datetime
import gzip
import json
import re
import zipfile
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from pneucli.arrays import Array

RATE, COUNT = 1000.0, 1600  # Hz, rows
NOISE = {"u": 0.0, "p1": 300.0, "x": 2e-5}  # V, Pa, m
EPOCH = 1_711_026_307.123  # s since 1970


def command(t: Array) -> Array:
    """Return the command in V."""
    return np.select([t < 0.1, t < 0.7, t < 1.1], [0.0, 5.0, -3.0], 2.0)


def pressure(t: Array) -> Array:
    """Return the pressure in Pa, absolute: from ambient, filled, vented, filled."""
    up = 1.013e5 + 4.2e5 * (1 - np.exp(-np.maximum(t - 0.1, 0.0) / 0.15))
    down = 1.3e5 + 3.7e5 * np.exp(-np.maximum(t - 0.7, 0.0) / 0.1)
    again = 1.35e5 + 2.0e5 * (1 - np.exp(-np.maximum(t - 1.1, 0.0) / 0.2))
    return np.select([t < 0.7, t < 1.1], [up, down], again)


def position(t: Array) -> Array:
    """Return the position in m."""
    return 0.1 + 0.06 * np.tanh((t - 0.35) / 0.1) - 0.05 * np.tanh((t - 0.9) / 0.08) + 0.03 * np.tanh((t - 1.35) / 0.07)


TRUTH: dict[str, Callable[[Array], Array]] = {"u": command, "p1": pressure, "x": position}


@dataclass
class Sheet:
    """What a laboratory writes: columns by header, and how. ``base`` is the reading of the clock (s) at t = 0.

    ``clocks`` has the stamps of columns on clocks of their own, ``gone`` the samples that were not measured.
    """

    columns: dict[str, Array | list[str]]
    base: float = 0.0
    kinds: list[str] = field(default_factory=list)
    preamble: list[str] = field(default_factory=list)
    units: list[str] = field(default_factory=list)
    decimal: str = "."
    delimiter: str = ","


def sheet(rng: np.random.Generator) -> Sheet:
    """Return the columns of one recording, with a random clock, random units and random faults."""
    t = np.arange(COUNT) / RATE
    values = {name: function(t) + NOISE[name] * rng.standard_normal(COUNT) for name, function in TRUTH.items()}
    found = Sheet({})
    _clock(found, t, rng)
    _units(found, values, rng)
    _faults(found, rng)
    return found


def _clock(found: Sheet, t: Array, rng: np.random.Generator) -> None:
    whole, fraction = np.floor(EPOCH + t), np.round(((EPOCH + t) % 1.0) * 1e9)
    start = datetime.datetime(2024, 10, 27, 23, 59, 59)
    days = [start + datetime.timedelta(seconds=float(s)) for s in t]
    utc = datetime.datetime(2024, 10, 27, 0, 59, 59, 400_000)
    summer = [utc + datetime.timedelta(seconds=float(s)) for s in t]
    kinds: dict[str, tuple[dict[str, Array | list[str]], float]] = {
        "seconds": ({"Time [s]": t}, 0.0),
        "seconds in words": ({"Time (seconds)": t}, 0.0),
        "milliseconds": ({"t [ms]": 1e3 * t}, 0.0),
        "no unit": ({"time": t}, 0.0),
        "bare milliseconds": ({"time": np.round(1e3 * t)}, 0.0),
        "coarse": ({"Time [s]": np.floor(100 * t + 1e-9) / 100}, 0.0),
        "unix ms": ({"timestamp": np.round(1e3 * (EPOCH + t))}, EPOCH),
        "unix us": ({"timestamp": np.round(1e6 * (EPOCH + t))}, EPOCH),
        "unix s": ({"timestamp": EPOCH + t}, EPOCH),
        "Excel days": ({"Time": 45_372.5 + t / 86_400}, 45_372.5 * 86_400),
        "wrapping us": ({"micros [us]": (np.round(1e6 * t) + 2**32 - 500_000) % 2**32}, (2**32 - 500_000) * 1e-6),
        "secs and nsecs": ({"header.stamp.secs": whole, "header.stamp.nsecs": fraction}, EPOCH),
        "seconds and ms": ({"sec": np.floor(t + 5), "ms": np.round(1e3 * t) % 1000}, 5.0),
        "date and time": (
            {"Datum": [f"{d:%d.%m.%Y}" for d in days], "Uhrzeit": [f"{d:%H:%M:%S.%f}"[:-3] for d in days]},
            0.0,
        ),
        "frames": ({"Zeit": [f"{d:%H:%M:%S:%f}" for d in days]}, 0.0),
        "zones": ({"Timestamp": [_local(d) for d in summer]}, 0.0),
        "steps": ({"dt [s]": np.full(t.size, 1e-3)}, 1e-3),
    }
    name = str(rng.choice(list(kinds)))
    found.columns, found.base = dict(kinds[name][0]), kinds[name][1]
    found.kinds.append(name)


def _local(utc: datetime.datetime) -> str:
    hours = 2 if utc < datetime.datetime(2024, 10, 27, 1) else 1
    return f"{(utc + datetime.timedelta(hours=hours)).isoformat(timespec='milliseconds')}+0{hours}:00"


def _units(found: Sheet, values: dict[str, Array], rng: np.random.Generator) -> None:
    pressures = {
        "P1 [Psi]": (values["p1"] - 1.013e5) / 6894.757293,
        "P1 [psia]": values["p1"] / 6894.757293,
        "P1 [bar]": values["p1"] / 1e5,
        "Druck_1 [mBar]": values["p1"] / 100,
        "p1 / KPa": (values["p1"] - 1.013e5) / 1e3,
        "pressure1 [MPA]": values["p1"] / 1e6,
        "P1 [cmH2O]": (values["p1"] - 1.013e5) / 98.0665,
        "P1 [inH2O]": (values["p1"] - 1.013e5) / 249.08891,
        "p1_Pa": values["p1"],
        "P1": values["p1"] / 1e5,
        "P1 [foo]": values["p1"] / 1e5,
        "P1 [0.01 bar]": values["p1"] / 1e3,
        "P1 [bar x 100]": values["p1"] / 1e3,
    }
    positions = {
        "Pos [mm]": 1e3 * values["x"],
        "Position [inches]": values["x"] / 0.0254,
        "x [0.1 mm]": 1e4 * values["x"],
        "Pos [counts]": np.round(values["x"] / 1e-5),
        "position": values["x"],
        "Weg [MM]": 1e3 * values["x"],
    }
    commands = {
        "U [V]": values["u"],
        "U_valve [Volts]": values["u"],
        "cmd [mV]": 1e3 * values["u"],
        "valve": values["u"],
    }
    for choices in (commands, pressures, positions):
        name = str(rng.choice(list(choices)))
        found.columns[name] = choices[name]
        found.kinds.append(name)


def _faults(found: Sheet, rng: np.random.Generator) -> None:
    u, p, x = list(found.columns)[-3:]
    kind = str(rng.choice(["none", "none", "marks", "zeros", "on change", "held", "saturated", "roll-over"]))
    found.kinds.append(kind)
    pressure_, place = np.array(found.columns[p], dtype=float), np.array(found.columns[x], dtype=float)
    if kind in ("marks", "zeros"):
        mark = 0.0 if kind == "zeros" else float(rng.choice([-9999.0, 65535.0, -999.0]))
        for start in rng.choice(np.arange(300, 1500, 60), 4, replace=False):
            pressure_[start : start + int(rng.integers(5, 20))] = mark
    if kind == "on change":
        u_values = np.array(found.columns[u], dtype=float)
        u_values[1:][np.diff(u_values) == 0] = np.nan
        found.columns[u] = u_values
    if kind == "held":
        place = np.repeat(place[::10], 10)
    if kind == "saturated":
        pressure_ = np.minimum(pressure_, np.quantile(pressure_, 0.8))
    if kind == "roll-over" and "counts" not in x:
        period = {
            "Pos [mm]": 100.0,
            "Position [inches]": 4.0,
            "x [0.1 mm]": 1000.0,
            "position": 0.1,
            "Weg [MM]": 100.0,
        }[x]
        place = np.mod(place, period)
    found.columns[p], found.columns[x] = pressure_, place


# ---- containers


def text_of(found: Sheet, rng: np.random.Generator) -> str:
    """Return a sheet as text, in one of the layouts of loggers."""
    german = any("Datum" in name or "Weg" in name for name in found.columns)
    delimiter, decimal = (";", ",") if german else (str(rng.choice([",", ";", "\t"])), ".")
    names, rows = list(found.columns), zip(*found.columns.values(), strict=True)
    lines = [delimiter.join(_field(value, decimal) for value in row) for row in rows]
    header = [delimiter.join(names)]
    layout = str(rng.choice(["plain", "plain", "preamble", "units row", "blank", "header again"]))
    found.kinds.append(layout)
    if layout == "preamble":
        header = ["Logger X200", "Operator: someone", "Serial 4711", *header]
    if layout == "units row" and all("[" in name for name in names):
        stems = [name.rpartition("[")[0].strip() for name in names]
        header = [delimiter.join(stems), delimiter.join(name.rpartition("[")[2].strip("]") for name in names)]
    if layout == "blank":
        header = [*header, ""]
    if layout == "header again":
        lines = [*lines[:800], header[0], *lines[800:]]
    return "\n".join([*header, *lines]) + "\n"


def _field(value: float | str, decimal: str) -> str:
    if isinstance(value, str):
        return value.replace(".", ",") if decimal == "," and ":" in value else value
    return (
        ""
        if np.isnan(value)
        else f"{value:.17g}"[:19].replace(".", decimal)
        if abs(value) > 1e4
        else f"{value:.6g}".replace(".", decimal)
    )


def write(found: Sheet, folder: Path, rng: np.random.Generator) -> Path:
    """Write a sheet into a random container; return the file."""
    has_text = any(isinstance(values, list) for values in found.columns.values())
    kinds = ["csv", "csv.gz", "zip", "csv.bz2", "xlsx"]
    kinds += [] if has_text else ["npz", "feather", "jsonl", "parquet", "mat", "mat4", "h5", "json"]
    kind = str(rng.choice(kinds))
    found.kinds.append(kind)
    path = folder / f"run_1.{kind.replace('mat4', 'mat')}"
    WRITERS[kind](path, found, rng)
    return path


def _write_text(path: Path, found: Sheet, rng: np.random.Generator) -> None:
    content = text_of(found, rng).encode()
    if path.suffix == ".gz":
        content = gzip.compress(content)
    if path.suffix == ".bz2":
        content = bz2.compress(content)
    path.write_bytes(content)


def _write_zip(path: Path, found: Sheet, rng: np.random.Generator) -> None:
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr("run_1.csv", text_of(found, rng))
        archive.writestr("README.txt", "what was recorded")


def _write_xlsx(path: Path, found: Sheet, _: np.random.Generator) -> None:
    write_workbook(path, [list(found.columns), *(list(row) for row in zip(*found.columns.values(), strict=True))])


def _write_npz(path: Path, found: Sheet, _: np.random.Generator) -> None:
    with zipfile.ZipFile(path, "w") as archive:
        for name, values in found.columns.items():
            with archive.open(f"{name.replace('/', 'in')}.npy", "w") as file:
                np.lib.format.write_array(file, np.asarray(values))


def _write_feather(path: Path, found: Sheet, _: np.random.Generator) -> None:
    import pyarrow as pa
    from pyarrow import feather

    feather.write_feather(pa.table(found.columns), path)


def _write_parquet(path: Path, found: Sheet, _: np.random.Generator) -> None:
    import pyarrow as pa
    import pyarrow.parquet as pq

    pq.write_table(pa.table(found.columns), path)


def _write_json_lines(path: Path, found: Sheet, _: np.random.Generator) -> None:
    rows = zip(*found.columns.values(), strict=True)
    clean = [[None if np.isnan(value) else float(value) for value in row] for row in rows]
    path.write_text("\n".join(json.dumps(dict(zip(found.columns, row, strict=True))) for row in clean) + "\n")


def _write_json(path: Path, found: Sheet, _: np.random.Generator) -> None:
    clean = {name: [None if np.isnan(v) else float(v) for v in values] for name, values in found.columns.items()}
    path.write_text(json.dumps({"data": clean}))


def _write_mat(path: Path, found: Sheet, rng: np.random.Generator) -> None:
    from scipy.io import savemat

    names = list(found.columns)
    signals = np.zeros(len(names) - 1, dtype=[("values", object), ("label", object), ("dimensions", object)])
    for number, name in enumerate(names[1:]):
        signals[number] = (np.asarray(found.columns[name])[:, None], name, 1.0)
    if rng.random() < 0.5 and len(names) == 4:
        savemat(path, {"ScopeData": {"time": np.asarray(found.columns[names[0]])[:, None], "signals": signals}})
        return
    logged = np.zeros(len(names), dtype=[("Name", object), ("Values", object)])
    for number, name in enumerate(names):
        logged[number] = (name, {"Data": np.asarray(found.columns[name])[:, None]})
    savemat(path, {"logsout": logged})


def _write_mat4(path: Path, found: Sheet, _: np.random.Generator) -> None:
    from scipy.io import savemat

    savemat(path, {_identifier(name): np.asarray(values) for name, values in found.columns.items()}, format="4")


def _identifier(name: str) -> str:
    return "".join(letter if letter.isalnum() else "_" for letter in name).strip("_").replace("__", "_")[:19]


def _write_hdf5(path: Path, found: Sheet, _: np.random.Generator) -> None:
    import h5py

    with h5py.File(path, "w") as file:
        for name, values in found.columns.items():
            file.create_dataset(f"run/{name.replace('/', 'in')}", data=values)


WRITERS: dict[str, Callable[[Path, Sheet, np.random.Generator], None]] = {
    **dict.fromkeys(("csv", "csv.gz", "csv.bz2"), _write_text),
    **{"zip": _write_zip, "xlsx": _write_xlsx, "npz": _write_npz, "feather": _write_feather, "parquet": _write_parquet},
    **{"jsonl": _write_json_lines, "json": _write_json, "mat": _write_mat, "mat4": _write_mat4, "h5": _write_hdf5},
}

_PARTS = {
    "[Content_Types].xml": '<?xml version="1.0"?><Types xmlns="http://schemas.openxmlformats.org/package/2006/content-types">'
    '<Default Extension="rels" ContentType="application/vnd.openxmlformats-package.relationships+xml"/>'
    '<Default Extension="xml" ContentType="application/xml"/><Override PartName="/xl/workbook.xml" ContentType='
    '"application/vnd.openxmlformats-officedocument.spreadsheetml.sheet.main+xml"/><Override PartName='
    '"/xl/worksheets/sheet1.xml" ContentType='
    '"application/vnd.openxmlformats-officedocument.spreadsheetml.worksheet+xml"/></Types>',
    "_rels/.rels": '<?xml version="1.0"?><Relationships xmlns="http://schemas.openxmlformats.org/package/2006/relationships">'
    '<Relationship Id="rId1" Type="http://schemas.openxmlformats.org/officeDocument/2006/relationships/officeDocument" '
    'Target="xl/workbook.xml"/></Relationships>',
    "xl/_rels/workbook.xml.rels": '<?xml version="1.0"?><Relationships xmlns='
    '"http://schemas.openxmlformats.org/package/2006/relationships"><Relationship Id="rId1" Type='
    '"http://schemas.openxmlformats.org/officeDocument/2006/relationships/worksheet" Target="worksheets/sheet1.xml"/>'
    "</Relationships>",
    "xl/workbook.xml": '<?xml version="1.0"?><workbook '
    'xmlns="http://schemas.openxmlformats.org/spreadsheetml/2006/main" '
    'xmlns:r="http://schemas.openxmlformats.org/officeDocument/2006/relationships"><sheets>'
    '<sheet name="log" sheetId="1" r:id="rId1"/></sheets></workbook>',
}


def write_workbook(path: Path, *sheets: list[list[float | str]], clock: str = "General") -> None:
    """Write sheets as Excel has them: a zip of a few files of XML; ``clock`` is the format of the first column."""
    styles = (
        '<?xml version="1.0"?><styleSheet xmlns="http://schemas.openxmlformats.org/spreadsheetml/2006/main"><numFmts>'
        f'<numFmt numFmtId="164" formatCode="{clock}"/></numFmts><cellXfs><xf numFmtId="0"/><xf numFmtId="164"/>'
        "</cellXfs></styleSheet>"
    )
    parts = {**_PARTS, "xl/styles.xml": styles}
    for name, line in (("xl/workbook.xml", "sheet "), ("xl/_rels/workbook.xml.rels", "Relationship ")):
        one = re.search(f"<{line}[^>]*/>", parts[name])[0]  # type: ignore[index]
        each = (re.sub(r"1(?=\"|\.xml)|(?<=log)", str(n + 1), one) for n in range(len(sheets)))
        parts[name] = parts[name].replace(one, "".join(each))
    for n, rows in enumerate(sheets, 1):
        parts[f"xl/worksheets/sheet{n}.xml"] = _sheet_xml(rows)
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as archive:
        for name, text in parts.items():
            archive.writestr(name, text)


def _sheet_xml(rows: list[list[float | str]]) -> str:
    cells = []
    for row in rows:
        inside = "".join(
            f'<c t="inlineStr"><is><t>{value}</t></is></c>' if isinstance(value, str) else
            ("<c/>" if np.isnan(value) else f"<c><v>{value!r}</v></c>".replace("np.float64(", "").replace(")", ""))
            for value in row
        )  # fmt: skip
        cells.append("<row>" + inside.replace("<c><v>", '<c s="1"><v>', 1) + "</row>")
    return (
        '<?xml version="1.0"?><worksheet xmlns="http://schemas.openxmlformats.org/spreadsheetml/2006/main"><sheetData>'
        f"{''.join(cells)}</sheetData></worksheet>"
    )
