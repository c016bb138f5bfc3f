"""Files here or on S3-like and other stores: raw files are fetched, results written whole or not at all."""

from __future__ import annotations

import re
import shutil
from collections.abc import Callable, Iterable, Iterator, Mapping
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from typing import Any, TypeVar
from urllib.parse import urlsplit

from pyarrow import fs

from pneucli.errors import InputError
from pneucli.imports import library_of_extra
from pneucli.io.artifacts import atomic_path

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


MAX_REQUESTS = 16  # requests to a store: each waits for an answer
T = TypeVar("T")


@dataclass(frozen=True)
class Store:
    """A folder of results at ``where``, a path or a URL.

    In a folder of this machine, or one that all workers see, a file is renamed to its place; on a store one request
    writes it. Each method raises InputError where a store refuses.
    """

    where: str
    system: fs.FileSystem
    base: str

    def __str__(self) -> str:
        return self.where.partition("?")[0]

    @property
    def folder(self) -> Path | None:
        """The folder, where it is one of this machine."""
        return None if is_remote(self.where) else Path(self.where)

    def read(self, name: str) -> bytes | None:
        """Return a file's content, None where there is none, or none that can be read here."""

        def content() -> bytes | None:
            try:
                if self.folder is not None:
                    return (self.folder / name).read_bytes()
                with self.system.open_input_stream(f"{self.base}/{name}") as file:
                    return bytes(file.read())
            except OSError as error:
                if self.folder is None and not isinstance(error, FileNotFoundError):
                    raise
                return None

        return self._request(content)

    def read_all(self, names: Iterable[str]) -> dict[str, bytes | None]:
        """Return the content of several files, None where there is none."""
        wanted = list(names)
        with ThreadPoolExecutor(MAX_REQUESTS) as pool:
            return dict(zip(wanted, pool.map(self.read, wanted), strict=True))

    def copy_file(self, name: str, source: Path) -> None:
        """Write a copy of the file ``source``."""
        self.write(name, source.read_bytes())

    def write(self, name: str, content: str | bytes) -> None:
        """Write a file."""
        text = content.encode() if isinstance(content, str) else content
        if self.folder is None:
            self._request(lambda: self._upload(f"{self.base}/{name}", text))
            return
        with atomic_path(self.folder / name) as path:
            path.write_bytes(text)

    def _upload(self, path: str, content: bytes) -> None:
        if not self.where.lower().startswith("s3:"):  # a store of objects has no folders
            self.system.create_dir(path.rpartition("/")[0])
        with self.system.open_output_stream(path) as file:
            file.write(content)

    def local_copy(self, name: str, scratch: Path) -> Path:
        """Return the folder ``name`` as one of this machine, a copy in ``scratch`` where it is elsewhere."""
        if self.folder is not None:
            return self.folder / name
        for one in self.names(name):
            target = scratch / one
            target.parent.mkdir(parents=True, exist_ok=True)
            target.write_bytes(self.read(one) or b"")
        return scratch / name

    def names(self, under: str) -> set[str]:
        """Return the names of all files below a folder."""
        asked = fs.FileSelector(f"{self.base}/{under}", allow_not_found=True, recursive=True)
        found = self._request(lambda: self.system.get_file_info(asked))
        return {one.path[len(self.base) + 1 :] for one in found if one.type == fs.FileType.File}

    def remove(self, name: str) -> None:
        """Remove a file of a store."""
        self._request(lambda: self.system.delete_file(f"{self.base}/{name}"))

    def _request(self, question: Callable[[], T]) -> T:
        with store_errors_as_input_errors(self.where, "a store that answers and may be written to"):
            return question()


@lru_cache(maxsize=4)
def store_at(where: str) -> Store:
    """Return the folder of results at a path, or at a URL such as ``s3://bucket/plant-3``.

    Raises InputError where a URL is none that can be opened.
    """
    if not is_remote(where):
        return Store(where, fs.LocalFileSystem(), where)
    with store_errors_as_input_errors(where, "a URL such as s3://bucket/folder"):
        system, base = filesystem_of(where)
    return Store(where, system, base.rstrip("/"))


def mirror_folder(source: Path, store: Store, folders: Mapping[str, str]) -> None:
    """Make what is below ``source`` so in a store.

    Below the ``folders`` files that end as stated go, where they are not in ``source``.
    """
    names = {path.relative_to(source).as_posix(): path for path in source.rglob("*") if path.is_file()}
    for name, path in names.items():
        store.copy_file(name, path)
    for folder, ending in folders.items():
        for old in store.names(folder) - names.keys():
            if old.endswith(ending):
                store.remove(old)
