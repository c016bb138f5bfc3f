"""Texts as recorders write them by their makers' documentation: a tank behind a valve, read without a line by hand."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np
import pyarrow.parquet as pq
import pytest

from pneucli.config import load
from pneucli.pipeline.context import Context
from pneucli.stages import ingest, init

COUNT = 700
Rows = list[tuple[float, float, float, float]]


def tank() -> Rows:
    """Return t (s), u (V), p_supply and p1 (bar, absolute): filled for 2 s, vented for 2 s, again."""
    rng, t = np.random.default_rng(3), 0.01 * np.arange(COUNT)
    filling = t % 4.0 < 2.0
    u = np.where(filling, 8.0, -8.0)
    p1 = np.where(filling, 7.0 - 5.987 * np.exp(-(t % 4.0) / 0.4), 1.013 + 5.9 * np.exp(-(t % 4.0 - 2.0) / 0.3))
    noise = 0.004 * rng.standard_normal((2, COUNT))
    return [*zip(t.tolist(), u.tolist(), (7.013 + noise[0]).tolist(), (p1 + noise[1]).tolist(), strict=True)]


def lines(*head: str, rows: Iterator[str] | list[str], end: str = "\r\n") -> str:
    """Return lines of a head and rows as text."""
    return end.join([*head, *rows]) + end


def hioki_memory_hicorder(rows: Rows) -> str:
    """MR8880, appendix 4 of its manual: a line of comments above, a comma behind each row."""
    head = (
        '"File name","WAVE0001.CSV","V1.00"',
        '"Title comment",""',
        '"Start trigger time","\'26-03-11 09:15:02"',
        '"CH","CH1","CH2","CH3",',
        '"Mode","DC","DC","DC",',
        '"Range","10V","10V","10V",',
        '"Comment","valve command","supply pressure","tank pressure",',
        '"Scaling","Off","On","On",',
        '"Ratio"," 1.00000E+00"," 1.00000E+00"," 1.00000E+00",',
        '"Offset"," 0.00000E+00"," 0.00000E+00"," 0.00000E+00",',
        '"Time","CH1[V]","CH2[bar]","CH3[bar]",',
    )
    return lines(*head, rows=[f"{t:.9E},{u: .5E},{s: .5E},{p: .5E}," for t, u, s, p in rows])


def hioki_hilogger(rows: Rows) -> str:
    """LR8431, appendix 3 of its manual: a line a channel, and columns of alarms behind the readings."""
    head = (
        '"File name","WAVE0001.CSV","V 1.00"',
        '"Title comment",""',
        '"Trigger Time","\'26-03-11 09:15:02"',
        '"Ch","Mode","Range","Comment","Scaling","Ratio","Offset"',
        '"CH-1","Voltage","10V","valve command","Off","-","-"',
        '"CH-2","Voltage","10V","supply pressure","On","1.00000E+00","0.00000E+00"',
        '"CH-3","Voltage","10V","tank pressure","On","1.00000E+00","0.00000E+00"',
        '"ALM","Alarm","","",',
        '"Time","CH-1[V]","CH-2[bar]","CH-3[bar]","ALM-CH1","ALM-OUT","Event",',
    )
    return lines(*head, rows=[f"{t:.9E},{u: .5E},{s: .5E},{p: .5E},0,0,0," for t, u, s, p in rows])


def hioki_8807(rows: Rows) -> str:
    """8807, section 12.5 of its manual: names and units behind keys that have no column, and a line "DATA"."""
    head = (
        '"COMMENT","8807 MEM DATA"',
        '"DATE","03-11-2026"',
        '"TIME","09:15:02"',
        '"NUM_SIGS",4',
        '"INTERVAL",1.000E-02',
        '"HORZ_UNITS","S"',
        '"VERT_UNITS","S","V","bar","bar"',
        '"SIGNAL","TIME","U_VALVE","P_SUPPLY","P1"',
        '"DATA"',
    )
    return lines(*head, rows=[f"{t:.4E},{u:+.4E},{s:+.4E},{p:+.4E}" for t, u, s, p in rows])


def yokogawa_dlm(rows: Rows) -> str:
    """DLM3000, appendix 3 of its manual: no column of time, names and units in lines of keys, an empty first column."""
    head = (
        '"Header Size","17"',
        '"Model Name","DLM3000"',
        '"Comment",""',
        '"BlockNumber","1"',
        '"TraceName","u","p_supply","p1"',
        f'"BlockSize","{COUNT}","{COUNT}","{COUNT}"',
        '"VUnit","V","bar","bar"',
        '"SampleRate","100","100","100"',
        '"HResolution","1.0E-02","1.0E-02","1.0E-02"',
        '"HOffset","0.0","0.0","0.0"',
        '"HUnit","s","s","s"',
        '"Date","2026/03/11","2026/03/11","2026/03/11"',
        '"Time","09:15:02.00","09:15:02.00","09:15:02.00"',
        "",
    )
    return lines(*head, rows=[f",{u:.5E},{s:.5E},{p:.5E}" for _, u, s, p in rows])


def picoscope(rows: Rows) -> str:
    """PicoScope 6, user's guide: units in round brackets below the names, an empty line, times before the trigger."""
    head = ("Time,Channel A,Channel B,Channel C", "(ms),(V),(bar),(bar)", "")
    return lines(*head, rows=[f"{1e3 * t - 1000:.5f},{u:.5f},{s:.5f},{p:.5f}" for t, u, s, p in rows])


def twin_builder(rows: Rows) -> str:
    """Ansys Twin Builder, "CSV file format": names in quotation marks behind blanks."""
    head = '"Time [ms]", "VALVE.U [V]", "SUPPLY.P [bar]", "TANK.P [bar]"'
    return lines(head, rows=[f"{1e3 * t:g},{u:.4f},{s:.5f},{p:.5f}" for t, u, s, p in rows], end="\n")


def rohde_schwarz(rows: Rows) -> str:
    """RTM, user manual: "in s" is the name of the clock."""
    head = "in s,U in V,P_SUPPLY in bar,P1 in bar"
    return lines(head, rows=[f"{t:.6E},{u:.4E},{s:.5E},{p:.5E}" for t, u, s, p in rows], end="\n")


def druck(rows: Rows) -> str:
    """DPI620, user manual 4.6: lines of the channels in front of the header, date and time apart."""
    head = (
        "FILENAME,LOG0001.CSV",
        "COLUMNS,6",
        "START,11/03/2026 09:15:02",
        "VERSION,2",
        "CHANNEL,CH1,Voltage,V",
        "",
        "Date,Time,ID,CH1,P supply,P tank",
    )
    return lines(
        *head,
        rows=[f"11/03/2026,09:15:{2 + t:06.3f},{n},{u:.3f},{s:.5f},{p:.5f}" for n, (t, u, s, p) in enumerate(rows)],
    )


def sapphire(rows: Rows) -> str:
    """stPro, "CSV file layout": names, units, descriptions; words where a value is missing or bad."""
    head = (
        '" ","5XV101 out","5PT100 pv","5PT101 pv"',
        '" ","V","BARA","BARA"',
        '" ","Valve comm","Supply pre","Tank press"',
    )
    words = {50: "MISSING", 51: "MISSING", 90: "BAD"}
    body = [
        f'"03/11/2026 {9 + n // 3600:02}:{n // 60 % 60:02}:{n % 60:02}", {u:.3f}, {s:.5f}, {words.get(n, f"{p:.5f}")}'
        for n, (_, u, s, p) in enumerate(rows)
    ]
    return lines(*head, rows=body)


def panasonic(rows: Rows) -> str:
    """FPWIN, "CSV format" of a trace: six lines of heads, the names in the second, and a line where it triggered."""
    head = (
        '"Rig log"',
        '"Date","Time","Obtaining interval",1,2,3',
        '"","","","u","p supply","p1"',
        '"","","","MOMENT","MOMENT","MOMENT"',
        '"","","","FLT","FLT","FLT"',
        '"","","","V","bar","bar"',
    )
    body = [f"2026/03/11,09:15:{2 + int(t):02},1,{u:.3f},{s:.5f},{p:.5f}" for t, u, s, p in rows]
    return lines(*head, rows=[*body[:400], "2026/03/11,09:15:06,0,STOP TRG", *body[400:]])


def labview(rows: Rows) -> str:
    """LVM 2.0, National Instruments' specification: two heads, units behind a key, a column of comments."""
    head = (
        "LabVIEW Measurement\t",
        "Writer_Version\t2",
        "Separator\tTab",
        "X_Columns\tOne",
        "***End_of_Header***\t",
        "\t",
        "Channels\t3\t\t\t",
        f"Samples\t{COUNT}\t{COUNT}\t{COUNT}\t",
        "Y_Unit_Label\tV\tbar\tbar\t",
        "X_Dimension\tTime\tTime\tTime\t",
        "X0\t0.0\t0.0\t0.0\t",
        "Delta_X\t0.01\t0.01\t0.01\t",
        "***End_of_Header***\t\t\t\t",
        "X_Value\tValve\tSupply\tTank\tComment",
    )
    return lines(*head, rows=[f"{t:.6f}\t{u:.6f}\t{s:.6f}\t{p:.6f}" for t, u, s, p in rows])


def motion_scope(rows: Rows) -> str:
    """Motion Scope, "Export": samples by number, names with the unit behind a blank."""
    head = "Sample #\tAx 0 DAC Out\tSupply bar\tTank bar"
    return lines(head, rows=[f"{n}\t{u:.4f}\t{s:.4f}\t{p:.4f}" for n, (_, u, s, p) in enumerate(rows)])


def indramotion(rows: Rows) -> str:
    """IndraMotion MTX, section 12: sections in front of the rows, and behind them."""
    head = ("[Settings]", "[DATE]", "11.03.2026 09:15:02", "[Data]", "u_valve;p_supply [bar];p1 [bar]")
    body = [f"{u:.4f};{s:.4f};{p:.4f}" for _, u, s, p in rows]
    return lines(*head, rows=[*body, "[Statistics]", "NmbOfSamples", str(COUNT)])


def step_7(rows: Rows) -> str:
    """S7-1200, "Data logs": a record's number, date and time apart, "//END" behind the rows."""
    head = "Record,Date,UTC Time,ValveOut,PressSupply,PressTank"
    body = [
        f"{n + 1}, 03/11/2026, 09:15:{2 + t:06.3f}, {u:.3f}, {s:.4f}, {p:.4f}" for n, (t, u, s, p) in enumerate(rows)
    ]
    return lines(head, rows=[*body, "//END"])


def mitsubishi(rows: Rows) -> str:
    """MELSEC iQ-R, "Unicode text file": what the lines are, data types, an index, a column of triggers."""
    head = (
        "[LOGGING]\tRCPU_1\t3\t4\t5",
        "LOG01",
        "DATETIME[YYYY/MM/DD hh:mm:ss.sss]\tINDEX\tFLOAT[EXP.5]\tFLOAT[EXP.5]\tFLOAT[EXP.5]\tTRIGGER[*]",
        "TIME\tINDEX\tu_valve\tp_supply\tp1\tTRIGGER",
    )
    body = [
        f"2026/03/11 09:15:{2 + t:06.3f}\t{n + 1}\t{u:.5E}\t{s:.5E}\t{p:.5E}\t" for n, (t, u, s, p) in enumerate(rows)
    ]
    return lines(*head, rows=body)


RECORDERS: dict[Callable[[Rows], str], float] = {  # with the period that is read, 0 where people have to state it
    **dict.fromkeys((hioki_memory_hicorder, hioki_hilogger, hioki_8807, yokogawa_dlm, picoscope), 0.01),
    **dict.fromkeys((twin_builder, rohde_schwarz, druck, labview, step_7, mitsubishi), 0.01),
    **{sapphire: 1.0, panasonic: 0.0, motion_scope: 0.0, indramotion: 0.0},
}


@pytest.mark.parametrize(("recorder", "period"), RECORDERS.items(), ids=lambda one: getattr(one, "__name__", ""))
def test_a_recorder_s_layout_is_read_without_a_line_by_hand(
    recorder: Callable[[Rows], str], period: float, tmp_path: Path
) -> None:
    rows = tank()
    encoding = "utf-16" if recorder is mitsubishi else "utf-8"
    (tmp_path / "step.csv").write_text(recorder(rows), encoding=encoding, newline="")
    init.create(tmp_path / "rig", [tmp_path / "step.csv"])
    pipeline = tmp_path / "rig" / "pipeline.toml"
    text = pipeline.read_text(encoding="utf-8")
    to_fill = re.findall(r'"[^"]*\?[^"]*"', text)
    assert to_fill == ['"? l"'] if period else sorted(to_fill) == ['"? l"', '"row / ?"']
    pipeline.write_text(text.replace('"? l"', '"0.16 l"').replace('"row / ?"', '"row / 100"'), encoding="utf-8")
    (tmp_path / "out").mkdir()
    ingest.run(Context(pipeline, load(pipeline), tmp_path / "out", tmp_path))
    read = pq.read_table(tmp_path / "out" / "signals.parquet").to_pydict()
    assert np.median(np.diff(read["time"])) == pytest.approx(period or 0.01, abs=1e-9)
    for name, place, one in (("u", 1, 1.0), ("p_supply", 2, 1e5), ("p1", 3, 1e5)):
        true, found = np.array([row[place] for row in rows]), np.array(read[name], dtype=float)
        known = np.isfinite(found)
        assert np.count_nonzero(~known) <= 3, name
        np.testing.assert_allclose(found[known], one * true[known], atol=2e-3 * one, err_msg=name)
