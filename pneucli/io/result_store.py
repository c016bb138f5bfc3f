"""A folder of results, here or on an S3-like store: files are written whole or not at all."""

from __future__ import annotations

import shutil
from collections.abc import Callable, Iterable, Mapping
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from typing import TypeVar

from pyarrow import fs

from pneucli.errors import InputError
from pneucli.io.artifacts import atomic_path
from pneucli.io.remote_files import filesystem_of, is_remote, store_error

MAX_REQUESTS = 16  # requests to a store: each waits for an answer
T = TypeVar("T")


class LocalFolder:
    """A folder of this machine, or one that all workers see."""

    def __init__(self, path: Path) -> None:
        self.path = path

    def __str__(self) -> str:
        return str(self.path)

    def read(self, name: str) -> bytes | None:
        """Return a file's content, None where there is none."""
        try:
            return (self.path / name).read_bytes()
        except OSError:
            return None

    def read_all(self, names: Iterable[str]) -> dict[str, bytes | None]:
        """Return the content of several files, None where there is none."""
        return {name: self.read(name) for name in names}

    def copy_file(self, name: str, source: Path) -> None:
        """Write a copy of the file ``source``."""
        with atomic_path(self.path / name) as path:
            shutil.copyfile(source, path)

    def write(self, name: str, text: str) -> None:
        """Write a text."""
        with atomic_path(self.path / name) as path:
            path.write_text(text, encoding="utf-8")

    def local_copy(self, name: str, scratch: Path) -> Path:
        """Return the folder ``name`` as one of this machine, a copy in ``scratch`` where it is elsewhere."""
        return self.path / name

    def names(self, under: str) -> set[str]:
        """Return the names of all files below a folder."""
        return {path.relative_to(self.path).as_posix() for path in (self.path / under).rglob("*") if path.is_file()}

    def remove(self, name: str) -> None:
        """Remove a file, and its folder where that is empty then."""
        path = self.path / name
        path.unlink()
        if not any(path.parent.iterdir()):
            path.parent.rmdir()


@dataclass(frozen=True)
class RemoteFolder:
    """A folder of a store at ``url``: one request writes a file, so it is there whole or not at all.

    Its methods are those of :class:`LocalFolder`; each raises InputError where the store refuses.
    """

    url: str
    system: fs.FileSystem
    base: str

    def __str__(self) -> str:
        return self.url.partition("?")[0]

    def read(self, name: str) -> bytes | None:
        """Return a file's content, None where there is none."""

        def content() -> bytes | None:
            try:
                with self.system.open_input_stream(f"{self.base}/{name}") as file:
                    return bytes(file.read())
            except FileNotFoundError:
                return None

        return self._request(content)

    def read_all(self, names: Iterable[str]) -> dict[str, bytes | None]:
        """Return the content of several files, None where there is none."""
        wanted = list(names)
        with ThreadPoolExecutor(MAX_REQUESTS) as pool:
            return dict(zip(wanted, pool.map(self.read, wanted), strict=True))

    def copy_file(self, name: str, source: Path) -> None:
        """Write a copy of the file ``source``."""
        self._write(name, source.read_bytes())

    def write(self, name: str, text: str) -> None:
        """Write a text."""
        self._write(name, text.encode())

    def _write(self, name: str, content: bytes) -> None:
        def written() -> None:
            path = f"{self.base}/{name}"
            if not self.url.lower().startswith("s3:"):  # a store of objects has no folders
                self.system.create_dir(path.rpartition("/")[0])
            with self.system.open_output_stream(path) as file:
                file.write(content)

        self._request(written)

    def local_copy(self, name: str, scratch: Path) -> Path:
        """Return a copy of the folder ``name`` in ``scratch``."""
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
        """Remove a file."""
        self._request(lambda: self.system.delete_file(f"{self.base}/{name}"))

    def _request(self, question: Callable[[], T]) -> T:
        try:
            return question()
        except Exception as error:  # whatever a store may say
            raise store_error(self.url, error, "a store that answers and may be written to") from error


Store = LocalFolder | RemoteFolder


@lru_cache(maxsize=4)
def store_at(where: str) -> Store:
    """Return the folder of results at a path, or at a URL such as ``s3://bucket/plant-3``.

    Raises InputError where a URL is none that can be opened.
    """
    if not is_remote(where):
        return LocalFolder(Path(where))
    try:
        system, base = filesystem_of(where)
    except InputError:
        raise
    except Exception as error:  # whatever a store may say
        raise store_error(where, error, "a URL such as s3://bucket/folder") from error
    return RemoteFolder(where, system, base.rstrip("/"))


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
