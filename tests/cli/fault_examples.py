"""Provoke each kind of fault as its example states, and print what the program says: ``python -m ... CODE``."""

import contextlib
import io
import os
import re
import shlex
import sys
import zipfile
from collections.abc import Iterator, Sequence
from pathlib import Path
from unittest import mock

from pneucli import cli
from pneucli.cli.commands.explain import Example, base_files
from pneucli.errors import InputError


def write_files(example: Example, folder: Path) -> None:
    """Write the files of an example into a folder."""
    base = base_files()
    if example.change:
        old, new = example.change
        changed = {name: text.replace(old, new) for name, text in base.items()}
        assert changed != base, old
        base = changed
    for name, text in {**base, **example.files}.items():
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
        (folder / name).write_text(text, encoding=example.encoding if name.endswith(".toml") else "utf-8")
    for name, members in example.zip.items():
        with zipfile.ZipFile(folder / name, "w") as archive:
            for member in members:
                archive.write(folder / member, member)


def provoke(example: Example, folder: Path) -> tuple[int, str]:
    """Run an example in a folder; return its exit code and what it prints, with paths from that folder."""
    write_files(example, folder)
    printed = io.StringIO()
    with (
        contextlib.chdir(folder),
        without_packages(example.without),
        mock.patch.dict(os.environ),
        contextlib.redirect_stderr(printed),
        contextlib.redirect_stdout(printed),
    ):
        os.environ.pop("BENCH_DATA", None)
        code = _run_python(example.python) if example.python else _run_command(example.command)
    text = printed.getvalue().replace(f"{folder.resolve()}{os.sep}", "").replace(str(folder.resolve()), ".")
    lines = [line for line in text.splitlines() if not re.match(r"running |  .* \(.* s, .*\)$", line)]
    return code, "\n".join(lines)


@contextlib.contextmanager
def without_packages(names: Sequence[str]) -> Iterator[None]:
    """Let packages seem not to be installed."""
    had = {name: sys.modules.get(name) for name in names}
    sys.modules.update(dict.fromkeys(names, None))  # type: ignore[arg-type]
    try:
        yield
    finally:
        for name, module in had.items():
            if module is None:
                del sys.modules[name]
            else:
                sys.modules[name] = module


def _run_command(command: str) -> int:
    with mock.patch.object(sys, "argv", shlex.split(command)):
        try:
            cli.main()
        except SystemExit as end:
            return int(end.code or 0)
    return 0


def _run_python(code: str) -> int:
    try:
        exec(code, {})
    except InputError as error:
        print(f"error: {error}")
        return error.exit_code
    return 0
