"""Texts as recorders write them by their makers' documentation: a tank behind a valve, read without a line by hand."""

import json
import re
from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np
import pyarrow.parquet as pq
import pytest

from pneucli.config import load
from pneucli.pipeline.graph import Context
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


def hioki_8402(rows: Rows) -> str:
    """LR8402, appendix 4 of its manual: the table of channels is narrower than the rows, which end with an event."""
    head = (
        '"File name","AUTO0001.CSV","V 1.00a"',
        '"CH","A 1- 1","A 1- 2","A 1- 3","ALM-1","ALM-SOURCE-1"',
        '"Mode","Voltage","Voltage","Voltage","Alarm","Alarm Source"',
        '"Comment","U valve","P supply","P1","",""',
        '"Time","1-1[V]","1-2[bar]","1-3[bar]","ALM-1","ALM-SOURCE-1","Event",',
    )
    return lines(*head, rows=[f'{t:.9E}, {u:.5E}, {s:.5E}, {p:.5E},0,"",0,' for t, u, s, p in rows])


def yokogawa_gx(rows: Rows) -> str:
    """GX20, app. 6 of its manual: tags, units and kinds above the rows, the least and the most of each interval."""
    head = (
        "Model,GX20,,,,,,",
        "Ch,,0001,0001,0002,0002,0003,0003",
        "Tag,,U valve,U valve,P supply,P supply,P tank,P tank",
        "Unit,,V,V,bar,bar,bar,bar",
        "Kind,,Min,Max,Min,Max,Min,Max",
    )
    body = [
        f"26/03/11 09:15:{2 + n // 100:02},{10 * (n % 100):03},{u},{u},{s:.4f},{s + 0.01:.4f},{p:.4f},{p + 0.01:.4f}"
        for n, (_, u, s, p) in enumerate(rows)
    ]
    return lines(*head, rows=body)


def dewesoft(rows: Rows) -> str:
    """Dewesoft X, "Export reduced data": mean, least and most of each channel in columns."""
    names = [f"{name}/{kind} ({unit})" for name, unit in CHANNELS for kind in ("AVE", "MIN", "MAX")]
    head = ("Data info", "Sample rate: 1000", "", "\t".join(["Time (s)", *names]))
    each = [[t, *(v + d for v in values for d in (0.0, -0.02, 0.02))] for t, *values in rows]
    return lines(*head, rows=["\t".join(f"{value:.5f}" for value in row) for row in each])


CHANNELS = (("U", "V"), ("Psup", "bar"), ("Ptank", "bar"))


def campbell(rows: Rows) -> str:
    """CR1000, TOA5: four lines of heads, the last of them how values are reduced."""
    head = (
        '"TOA5","CR1000","CR1000","4711","CR1000.Std.32","CPU:tank.CR1","8999","Fast"',
        '"TIMESTAMP","RECORD","Valve_Avg","PSup_Avg","PTank_Avg","Batt_V_Min"',
        '"TS","RN","V","bar","bar","Volts"',
        '"","","Avg","Avg","Avg","Min"',
    )
    return lines(
        *head, rows=[f'"2026-03-11 09:15:{2 + t:05.2f}",{n},{u},{s},{p},12.6' for n, (t, u, s, p) in enumerate(rows)]
    )


def hobo(rows: Rows) -> str:
    """HOBOware, "Export table data": units behind commas, serial numbers of logger and sensor behind the names."""
    names = [f'"{name}, {unit} (LGR S/N: 20345, SEN S/N: {n})"' for n, (name, unit) in enumerate(HOBO)]
    head = ('"Plot Title: tank"', ",".join(['"#"', '"Date Time, GMT+01:00"', *names, '"End Of File (LGR S/N: 20345)"']))
    return lines(
        *head, rows=[f"{n},03/11/26 09:15:{2 + t:05.2f} AM,{u},{s},{p}," for n, (t, u, s, p) in enumerate(rows)]
    )


HOBO = (("Voltage", "V"), ("Supply Pres", "bar"), ("Tank Pres", "bar"))


def benchlink(rows: Rows) -> str:
    """BenchLink Data Logger 3: numbers of channels in the names, an alarm beside each, a colon before milliseconds."""
    names = [f"{101 + n} <{name}> ({unit})\tAlarm {101 + n}" for n, (name, unit) in enumerate(BENCHLINK)]
    body = [
        f"{n}\t03/11/2026 09:15:{2 + n // 100:02}:{10 * (n % 100):03}\t{u:.4f}\t0\t{s:.5f}\t0\t{p:.5f}\t0"
        for n, (_, u, s, p) in enumerate(rows)
    ]
    return lines("Owner:\tLab", "Scan Control:", "\t".join(["Scan", "Time", *names]), rows=body)


BENCHLINK = (("Valve", "VDC"), ("P supply", "BAR"), ("P1", "BAR"))


def wincc(rows: Rows) -> str:
    """WinCC Comfort, "Format of logs": Time_ms has days since 1900 times a million, and a row says that it stopped."""
    body = []
    for n, (t, *values) in enumerate(rows):
        stamp = f"{1e6 * (46092 + (9 * 3600 + 902 + t) / 86400):.6f}".replace(".", ",")
        texts = [f"{value:.5f}".replace(".", ",") for value in values]
        tags = zip(("DB_Ventil", "DB_Versorgungsdruck", "DB_Druck_1"), texts, strict=True)
        body += [f'"{tag}";"11.03.2026 09:15:{2 + n // 100:02}";{text};1;{stamp}' for tag, text in tags]
    head = '"VarName";"TimeString";"VarValue";"Validity";"Time_ms"'
    return lines(head, rows=[*body, f'"$RT_OFF$";"11.03.2026 09:15:09";0;2;{stamp}'])


def codesys_trace(rows: Rows) -> str:
    """Automation Builder, "Trace in ASCII file": a column "Cycle" has the milliseconds."""
    head = ("CODESYS Trace", "D:\\PROJECTS\\TANK.PRO", "Cycle PLC_PRG.rValve PLC_PRG.rPSupply PLC_PRG.rPTank")
    return lines(*head, rows=[f"{1000 * t:.0f} {u:.4f} {s:.5f} {p:.5f}" for t, u, s, p in rows])


def serial_plotter(rows: Rows) -> str:
    """Arduino's serial plotter: each cell says its name."""
    return lines("ready", rows=[f"t_ms:{1000 * t:.0f},U:{u:.3f},Psup:{s:.5f},P1:{p:.5f}" for t, u, s, p in rows])


def pi_datalink(rows: Rows) -> str:
    """PI DataLink, "Compressed data": a tag above each pair of stamp and value."""
    head = ("Rig:Valve.PV,,Rig:Supply_P.PV,,Rig:Tank_P.PV,", "Time,Value,Time,Value,Time,Value")
    stamps = [f"11-Mar-26 09:15:{2 + t:06.3f}" for t, *_ in rows]
    body = zip(stamps, rows, strict=True)
    return lines(*head, rows=[f"{at},{u:.3f},{at},{s:.5f},{at},{p:.5f}" for at, (_, u, s, p) in body])


def rockwell_trend(rows: Rows) -> str:
    """Studio 5000, "Trend": a word in front of each line, a semicolon before milliseconds, tags of transmitters."""
    head = (
        '"Header:","Trend File"',
        '"Sample Period:","10 ms"',
        "",
        '"Header","Date","Time","Program:Main.Valve_Cmd","Program:Main.Supply_PT","Program:Main.Tank_PT"',
    )
    stamps = [f'"11/03/2026","09:15:{2 + n // 100:02};{10 * (n % 100):03}"' for n in range(COUNT)]
    return lines(*head, rows=[f'"Data",{at},{u},{s},{p}' for at, (_, u, s, p) in zip(stamps, rows, strict=True)])


def ros2_echo(rows: Rows) -> str:
    """``ros2 topic echo --csv``: no names, whole seconds and nanoseconds apart."""
    stamps = [f"{1773216902 + n // 100},{10_000_000 * (n % 100)}" for n in range(COUNT)]
    return lines(rows=[f"{at},rig,{u},{s},{p},0.0" for at, (_, u, s, p) in zip(stamps, rows, strict=True)], end="\n")


def swiss_export(rows: Rows) -> str:
    """Excel in Switzerland: an apostrophe between thousands."""
    texts = (f"{1e3 * t:.0f};{1e3 * u:.0f};{1e3 * s:,.2f};{1e3 * p:,.2f}" for t, u, s, p in rows)
    head = "Zeit [ms];Ventil [mV];Versorgung [mbar];Druck 1 [mbar]"
    return lines(head, rows=[text.replace(",", "'") for text in texts])


def teac(rows: Rows) -> str:
    """TAFFmat text: keys before a blank, and what they say of each channel."""
    head = ("DATASET STEP", "SERIES U,P_SUPPLY,P1", "VERT_UNITS V,bar(a),bar(a)", "RATE 100.0,100.0,100.0", "DATA")
    return lines(*head, rows=[f"{u:.0f},{s:.5f},{p:.5f}" for _, u, s, p in rows])


def yokogawa_wvf(rows: Rows) -> str:
    """Header of WVF above its values: keys and blanks."""
    head = ("FormatVersion 1.11", "TraceName U P_SUPPLY P1", "BlockSize 700 700 700", "HResolution 0.01 0.01 0.01")
    head += ("VUnit V bar(a) bar(a)", "HUnit s s s")
    return lines(*head, rows=[f"{u:.0f} {s:.5f} {p:.5f}" for _, u, s, p in rows])


def monitor_with_names(rows: Rows) -> str:
    """A serial monitor that stamps the line of names, too."""
    stamped = [f"14:03:{t:06.3f} -> {u:.0f},{s:.5f},{p:.5f}" for t, u, s, p in rows]
    return lines("14:02:59.990 -> u,p_supply,p1", rows=stamped)


def log_in_brackets(rows: Rows) -> str:
    return lines(rows=[f"[2026-03-11 14:03:{t:06.3f}] u={u:.0f} p_supply={s:.5f} p1={p:.5f}" for t, u, s, p in rows])


def week_dates(rows: Rows) -> str:
    """ISO 8601, a day of a week, and notes between the rows."""
    table = [f"2026-W11-3T09:15:{t:06.3f},{u:.0f},{s:.5f},{p:.5f}" for t, u, s, p in rows]
    table[300:300] = ["TRIGGER at 3.000"]
    return lines("Time,u [V],p_supply [bar(a)],p1 [bar(a)]", rows=table)


def blanks_between_thousands(rows: Rows) -> str:
    table = [f"{t:.3f};{u:.0f};{1e3 * s:,.2f};{1e3 * p:,.2f}" for t, u, s, p in rows]
    table = [text.replace(",", " ").replace(".", ",") for text in table]
    return lines("Zeit [s];u [V];p_supply [mbar];p1 [mbar]", rows=table)


def tick_count(rows: Rows) -> str:
    """GetTickCount of Windows: milliseconds in 32 bits, which begin anew after 49.7 days."""
    stamped = [(round(2**32 - 2500 + 1e3 * t) % 2**32, *row) for t, *row in rows]
    return lines("TickCount,u,p_supply,p1", rows=[f"{t},{u:.0f},{s:.5f},{p:.5f}" for t, u, s, p in stamped])


def automation_studio(rows: Rows) -> str:
    """A trace of B&R: the type of each variable in brackets."""
    head = '"Index";"Time [us]";"Axis:ValveCmd [REAL]";"Io:PSupply [REAL]";"Io:PTank [REAL]"'
    return lines(head, rows=[f"{n};{1e6 * t:.0f};{u:.0f};{s:.5f};{p:.5f}" for n, (t, u, s, p) in enumerate(rows)])


def psi_without_unit(rows: Rows) -> str:
    to_psi = 1e5 / 6894.757293
    return lines("t,u,ps,p1", rows=[f"{t:.3f},{u:.0f},{to_psi * s:.4f},{to_psi * p:.4f}" for t, u, s, p in rows])


def frames(rows: Rows) -> str:
    """Grafana's frames of data: a field each, and their values."""
    t, *values = ([*own] for own in zip(*rows, strict=True))
    stamps = [round(1.7734e12 + 1e3 * one) for one in t]
    named = zip(("valve_cmd", "p_supply", "p_tank"), values, strict=True)
    found = [{"schema": {"fields": [{"name": "Time"}, {"name": n}]}, "data": {"values": [stamps, v]}} for n, v in named]
    return json.dumps({"results": {"A": {"frames": found}}})


def lists_of_lists(rows: Rows) -> str:
    return "\n".join(json.dumps(row) for row in (["t [s]", "u [V]", "p_supply [bar(a)]", "p1 [bar(a)]"], *rows))


def graphtec(rows: Rows) -> str:
    """GL840: a table of channels above, a line of units below the header, the sign apart from its number."""
    head = (
        *("Vendor,GRAPHTEC Corporation", "Model,GL840", "AMP settings", "CH,Signal name,Input,Range,Filter,Span"),
        *("CH1,valve command,DC,20V,Off,10.0,-10.0,V", "CH2,supply pressure,DC,10V,Off,10.0,-0.0,bar"),
        *("CH3,tank pressure,DC,10V,Off,10.0,-0.0,bar", "Data"),
        *("Number,Date&Time,ms,CH1,CH2,CH3,Alarm1-10", "NO.,Time,ms,V,bar,bar,A1234567890"),
    )
    signed = ([f"{'-' if one < 0 else '+'}{abs(one):9.5f}" for one in own] for _, *own in rows)
    stamped = ((n, f"2026/03/11 09:15:{int(row[0]):02}", round(1e3 * row[0]) % 1000) for n, row in enumerate(rows, 1))
    return lines(*head, rows=[",".join(map(str, (*a, *b, "LLLL"))) for a, b in zip(stamped, signed, strict=True)])


def winlog(rows: Rows) -> str:
    """An archive of Winlog Pro: a line of tags, and below it one of what they are."""
    tags = "Timestamp; AO_01.FLD_VALUE; AI_01.FLD_VALUE; AI_02.FLD_VALUE;"
    head = (tags, "; Comando valvola [V]; Pressione alimentazione [bar]; Pressione camera [bar];")
    return lines(*head, rows=[f"08/06/2026 12:13:{t:06.3f}; {u:.2f}; {s:.5f}; {p:.5f};" for t, u, s, p in rows])


def dasylab(rows: Rows) -> str:
    """Without a clock: the time between samples stands above."""
    head = ("DASYLab - V 13.00.00", "Delta : 0.01 sec.", "Ventil [V];Versorgungsdruck [bar];Kesseldruck [bar]")
    return lines(*head, rows=[f"{u:.2f};{s:.5f};{p:.5f}".replace(".", ",") for _, u, s, p in rows])


RECORDERS: dict[Callable[[Rows], str], float] = {  # with the period that is read, 0 where people have to state it
    **dict.fromkeys((hioki_memory_hicorder, hioki_hilogger, hioki_8807, yokogawa_dlm, picoscope), 0.01),
    **dict.fromkeys((twin_builder, rohde_schwarz, druck, labview, step_7, mitsubishi), 0.01),
    **dict.fromkeys((hioki_8402, yokogawa_gx, dewesoft, campbell, hobo, benchlink, wincc), 0.01),
    **dict.fromkeys((codesys_trace, serial_plotter, pi_datalink, rockwell_trend, ros2_echo, swiss_export), 0.01),
    **dict.fromkeys((teac, yokogawa_wvf, monitor_with_names, log_in_brackets, week_dates, tick_count, frames), 0.01),
    **dict.fromkeys((graphtec, winlog, dasylab), 0.01),
    **dict.fromkeys((blanks_between_thousands, automation_studio, psi_without_unit, lists_of_lists), 0.01),
    **{sapphire: 1.0, panasonic: 0.01, motion_scope: 0.0, indramotion: 0.0},
}


@pytest.mark.parametrize(("recorder", "period"), RECORDERS.items(), ids=lambda one: getattr(one, "__name__", ""))
def test_a_recorder_s_layout_is_read_without_a_line_by_hand(
    recorder: Callable[[Rows], str], period: float, tmp_path: Path
) -> None:
    rows = tank()
    encoding = "utf-16" if recorder in (mitsubishi, benchlink) else "utf-8"
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
    assert np.median(np.diff(read["time"])) == pytest.approx(period or 0.01, abs=1e-6)
    for name, place, one in (("u", 1, 1.0), ("p_supply", 2, 1e5), ("p1", 3, 1e5)):
        true, found = np.array([row[place] for row in rows]), np.array(read[name], dtype=float)
        known = np.isfinite(found)
        assert np.count_nonzero(~known) <= 3, name
        np.testing.assert_allclose(found[known], one * true[known], atol=2e-3 * one, err_msg=name)
