"""Files that hold no numbers, or that would have to be run, or that need another program first."""

from __future__ import annotations

from pathlib import Path

from pneucli.io.formats.base import Format


def _is_tar(head: bytes, _: Path) -> bool:
    return head[257:262] == b"ustar"


def _is_markup(head: bytes, path: Path) -> bool:
    start = head.lstrip(b"\xef\xbb\xbf \t\r\n")[:9].lower()
    return start.startswith((b"<?xml", b"<!doctype", b"<html", b"<table"))


ROS_1 = Format("bag", magic=(b"#ROSBAG V",), refused="bag of ROS 1; convert it with rosbags-convert, then use the mcap")
PICKLE = Format(
    "pickle",
    magic=(b"\x80\x04", b"\x80\x05"),
    refused="pickle of Python, which could run anything; save the arrays with numpy.savez",
)
DOCUMENT = Format("PDF", magic=(b"%PDF",), refused="PDF document; export the numbers as CSV")
PICTURE = Format("picture", magic=(b"\xff\xd8\xff", b"\x89PNG"), refused="picture; export the numbers as CSV")
SEVEN_ZIP = Format("7-Zip", magic=(b"7z\xbc\xaf\x27\x1c",), refused="7-Zip archive; unpack it first")
RAR = Format("RAR", magic=(b"Rar!\x1a\x07",), refused="RAR archive; unpack it first")
ZSTANDARD = Format("Zstandard", magic=(b"\x28\xb5\x2f\xfd",), refused="Zstandard file; unpack it first")
MARKUP = Format("XML", recognises=_is_markup, refused="XML or HTML document; export the numbers as CSV")
TAR = Format("tar", recognises=_is_tar, refused="tar archive; unpack it first")
