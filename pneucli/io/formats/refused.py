"""Files that hold no numbers, or that would have to be run, or that need another program first."""

from __future__ import annotations

from pneucli.io.formats.base import Format

# numbers in YAML, and no CSV below keys: "- t: 1" above "  u: 5", or "t: [1, 2"
_YAML = (
    rb"(?:\xef\xbb\xbf)?(?:(?:---\s+)?- \w+: -?\d\S*\s*\n +\w+: -?\d|\w+: ?\[-?\d[\d.eE+-]*, |"
    rb"---\s+(?:\w+: -?\d\S*\s*\n){2,}---)"
)
_MARKUP = rb"(?i)[\xef\xbb\xbf\s]*<(?:\?xml|!doctype|html|table)"
ROS_1 = Format("bag", magic=(b"#ROSBAG V",), refused="bag of ROS 1; convert it with rosbags-convert, then use the mcap")
PICKLE = Format(
    "pickle",
    magic=(b"\x80\x04", b"\x80\x05"),
    refused="pickle of Python, which could run anything; save the arrays with numpy.savez",
)
DOCUMENT = Format("PDF", magic=(b"%PDF",), refused="PDF document; export the numbers as CSV")
PICTURE = Format("picture", magic=(b"\xff\xd8\xff", b"\x89PNG"), refused="picture; export the numbers as CSV")
NETCDF_3 = Format(
    "netCDF 3",
    magic=(b"CDF\x01", b"CDF\x02", b"CDF\x05"),
    refused="file of netCDF 3; convert it with nccopy -k nc4 first",
)
SEVEN_ZIP = Format("7-Zip", magic=(b"7z\xbc\xaf\x27\x1c",), refused="7-Zip archive; unpack it first")
RAR = Format("RAR", magic=(b"Rar!\x1a\x07",), refused="RAR archive; unpack it first")
ZSTANDARD = Format("Zstandard", magic=(b"\x28\xb5\x2f\xfd",), refused="Zstandard file; unpack it first")
MARKUP = Format("XML", pattern=_MARKUP, refused="XML or HTML document; export the numbers as CSV")
YAML = Format("YAML", pattern=_YAML, refused="YAML document; export the numbers as CSV or JSON")
COMTRADE = Format(
    "COMTRADE",
    pattern=rb"[^\n]*,(?:1991|1999|2013)\s*\n\s*\d+\s*,\s*\d+A\s*,\s*\d+D\s*\n",
    refused="header of a COMTRADE recording; export both files as CSV",
)
TAR = Format("tar", pattern=rb"(?s).{257}ustar", refused="tar archive; unpack it first")
