"""Raw files that are not on this machine: S3-like stores through Arrow's filesystems, all else through fsspec."""

from __future__ import annotations

import re
import shutil
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any
from urllib.parse import urlsplit

from pyarrow import fs

from pneucli.errors import InputError
from pneucli.imports import library_of_extra

ARROW_SCHEMES = ("s3", "gs", "gcs", "hdfs", "abfs", "abfss", "file")
BLOCK_BYTES = 1 << 22  # bytes, copied at a time
_URL = re.compile(r"[a-z][a-z0-9+.-]+://", re.IGNORECASE)


def is_remote(text: str) -> bool:
    """Return whether a text is a URL, and not a path."""
    return _URL.match(text) is not None


def content_stamp(url: str) -> str:
    """Return what tells one content of a remote file from another without reading it: size and time, or a tag.

    Raises InputError where there is no such file or no answer.
    """
    with store_errors_as_input_errors(url):
        if _scheme(url) in ARROW_SCHEMES:
            system, path = fs.FileSystem.from_uri(url)
            with system.open_input_file(path):  # says that there is none, where there is none
                info = system.get_file_info(path)
            return f"{info.size} {info.mtime_ns}"
        info = _fsspec_filesystem(url).info(url)
        return " ".join(str(info.get(key)) for key in ("size", "ETag", "mtime", "LastModified", "Last-Modified"))


def fetch(url: str, folder: Path) -> Path:
    """Copy a remote file into ``folder`` under its own name; return its path there.

    Raises InputError as ``content_stamp``.
    """
    target = folder / (Path(urlsplit(url).path).name or "file")
    with store_errors_as_input_errors(url):
        system, path = filesystem_of(url)
        with system.open_input_stream(path) as source, target.open("wb") as file:
            shutil.copyfileobj(source, file, BLOCK_BYTES)
    return target


def filesystem_of(url: str) -> tuple[fs.FileSystem, str]:
    """Return the filesystem of a URL and the path in it; raises what either library raises."""
    if _scheme(url) in ARROW_SCHEMES:
        return fs.FileSystem.from_uri(url)
    other = _fsspec_filesystem(url)
    handler: Any = fs.FSSpecHandler
    return fs.PyFileSystem(handler(other)), other._strip_protocol(url)


def _scheme(url: str) -> str:
    return url.partition("://")[0].lower()


def _fsspec_filesystem(url: str) -> Any:
    return library_of_extra("fsspec", "remote", url).core.url_to_fs(url)[0]


@contextmanager
def store_errors_as_input_errors(url: str, wanted: str = "a file that is there, and may be read") -> Iterator[None]:
    """Let what a store says be an error of the input; a password in the URL is not shown."""
    try:
        yield
    except InputError:
        raise
    except Exception as error:  # whatever a store may say
        shown = re.sub(r"//[^/@]*@", "//", url)
        reason = (str(error).splitlines() or [type(error).__name__])[0]
        raise InputError(shown, f"cannot be read: {reason}", wanted, "check URL and access", code="E003") from error
