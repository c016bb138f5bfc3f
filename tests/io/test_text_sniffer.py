"""Where the table begins in a text of which nothing is known."""

from pathlib import Path

import pytest

from pneucli.errors import InputError
from pneucli.io.raw_file import Channel, RawFile
from pneucli.io.signal_reader import open_signals
from pneucli.io.text_sniffer import SniffedLayout, apply_sniffed, sniff

ROWS = 40


def rows(mark: str, decimal: str = ".", columns: int = 3) -> str:
    return "".join(
        mark.join(f"{n / 100 + k:.3f}".replace(".", decimal) for k in range(columns)) + "\n" for n in range(ROWS)
    )


END = "***End_of_Header***"
LVM = f"LabVIEW Measurement\t\nWriter_Version\t2\n{END}\n\nChannels\t2\nSamples\t40\t40\n{END}\t\t\n"
TEXTS = {
    "a header": ("t,p,x\n" + rows(","), SniffedLayout(True, 0, ",", ("t", "p", "x"), (), {})),
    "no header": (rows("\t"), SniffedLayout(False, 0, "\t", (), (), {})),
    "blanks": (rows("  "), SniffedLayout(False, 0, " ", (), (), {})),
    "decimal commas": ("t;p;x\n" + rows(";", ","), SniffedLayout(True, 0, ";", ("t", "p", "x"), (), {})),
    "a title and two rows of header": (
        "Test bench 3;;\nt;p;x\ns;bar;mm\n" + rows(";"),
        SniffedLayout(True, 1, ";", ("t", "p", "x"), ("s", "bar", "mm"), {}),
    ),
    "a preamble as wide as the table": (
        LVM + "X_Value\tp\tx\tComment\n" + rows("\t"),
        SniffedLayout(True, 7, "\t", ("X_Value", "p", "x"), (), {}),
    ),
    "names in a comment": ("# t p x\n" + rows(" "), SniffedLayout(False, 0, " ", ("t", "p", "x"), (), {})),
    "names in a comment, apart by commas": (
        "# rig 3\n# columns: t, p, x\n" + rows(" "),
        SniffedLayout(False, 0, " ", ("t", "p", "x"), (), {}),
    ),
    "lines of each channel below names and units": (
        "t;p;x\ns;bar;mm\n" + "".join(f"{n};sensor {n};{n} of 10 V\n" for n in "abcde") + rows(";"),
        SniffedLayout(False, 7, ";", ("t", "p", "x"), ("s", "bar", "mm"), {}),
    ),
    "a third row of header": (
        "t;p;x\ns;bar;mm\nclock;sensor 1;laser\n" + rows(";"),
        SniffedLayout(False, 3, ";", ("t", "p", "x"), ("s", "bar", "mm"), {}),
    ),
    "dots between thousands, decimal commas": (
        "".join(f"{n};1.{n:03d},5\n" for n in range(ROWS)),
        SniffedLayout(False, 0, ";", (), (), {1: "."}),
    ),
    "columns of fixed width": (
        "  Time [s]     U [V]\n" + "".join(f"{n:10.3f}{n / 2:10.3f}\n" for n in range(ROWS)),
        SniffedLayout(False, 1, " ", ("Time [s]", "U [V]"), (), {}),
    ),
    "dots between thousands": (
        "".join(f"{n}.000.000;7.{n:03d}\n" for n in range(1, ROWS)),
        SniffedLayout(False, 0, ";", (), (), {0: "."}),
    ),
    "text after a comma": ("t,p,x\n" + rows(",") + "1,2,3\n", SniffedLayout(True, 0, ",", ("t", "p", "x"), (), {})),
    "a command on change, and the header again": (
        "t [s]\tu\tp\n" + "1\t\t2\n" * ROWS + "t [s]\tu\tp\n" + "1\t\t2\n" * 5 + "1\t5\t2\n",
        SniffedLayout(True, 0, "\t", ("t [s]", "u", "p"), (), {}),
    ),
    "date and time parted by a blank, between tabs": (
        "Stamp\tAxis.Pos [mm]\tp\n" + "".join(f"2026-03-04 10:12:{n:02d}.000\t{n}.5\t3\n" for n in range(ROWS)),
        SniffedLayout(True, 0, "\t", ("Stamp", "Axis.Pos [mm]", "p"), (), {}),
    ),
    "a column of words": (
        "t,state\n" + "".join(f"{n},on\n" for n in range(ROWS)),
        SniffedLayout(True, 0, ",", ("t", "state"), (), {}),
    ),
}


@pytest.mark.parametrize("way", TEXTS)
def test_a_table_is_found(tmp_path: Path, way: str) -> None:
    text, expected = TEXTS[way]
    (tmp_path / "a.txt").write_text(text, encoding="utf-8")
    assert sniff(RawFile(tmp_path / "a.txt", {})) == expected


NO_NUMBERS = ("a column of words", "dots between thousands", "dots between thousands, decimal commas")
HEADER_LINES = {
    "date and time parted by a blank, between tabs": 1,
    **{"a header": 1, "decimal commas": 1, "a title and two rows of header": 3, "names in a comment": 1},
    **{"a preamble as wide as the table": 8, "a third row of header": 3, "text after a comma": 1},
    **{"names in a comment, apart by commas": 2, "lines of each channel below names and units": 7},
    **{"a command on change, and the header again": 2, "columns of fixed width": 1},
}


@pytest.mark.parametrize("way", [way for way in TEXTS if way not in NO_NUMBERS])
def test_what_is_found_reads_every_row(tmp_path: Path, way: str) -> None:
    raw = RawFile(tmp_path / "a.txt", {"time": Channel(1), "p1": Channel(2)})
    raw.path.write_text(TEXTS[way][0], encoding="utf-8")
    opened = open_signals(apply_sniffed(raw, sniff(raw)))
    rows = sum(batch["time"].size for batch in opened.batches())
    assert rows == TEXTS[way][0].count("\n") - HEADER_LINES.get(way, 0)


@pytest.mark.parametrize("text", ["only\nwords\nhere\n", "# 1\n# 2\n", "a,b\nc,d\n"])
def test_a_text_without_a_table_is_refused(tmp_path: Path, text: str) -> None:
    (tmp_path / "a.txt").write_text(text, encoding="utf-8")
    with pytest.raises(InputError, match="no table of numbers"):
        sniff(RawFile(tmp_path / "a.txt", {}))


def test_what_is_stated_is_taken(tmp_path: Path) -> None:
    (tmp_path / "a.txt").write_text("9;9\n8;8\n" + rows(";"), encoding="utf-8")
    found = sniff(RawFile(tmp_path / "a.txt", {}, header=False, delimiter=";", skip_rows=2))
    assert (found.header, found.skip_rows, found.delimiter) == (False, 2, ";")
