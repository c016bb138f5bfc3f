"""Read the pipeline file as text and as TOML tables, before any validation."""

import tomllib
from pathlib import Path
from typing import Any

from pneucli.errors import InputError
from pneucli.paths import require_printable


def read_toml(path: Path) -> tuple[str, dict[str, Any]]:
    """Return text and tables of a pipeline file.

    Raises InputError where there is no such file, or it is not UTF-8 or not TOML; the message has line and column.
    """
    require_printable(path, str(path))
    text = _text(path)
    try:
        return text, tomllib.loads(text)
    except tomllib.TOMLDecodeError as error:
        place = str(error).replace("end of document", f"the end, line {text.count(chr(10)) + 1}")
        raise InputError(
            str(path), f"not valid TOML: {place}", "a TOML file", "see https://toml.io", code="E020"
        ) from error
    except RecursionError as error:
        depths = [line.count("[") + line.count("{") for line in text.splitlines()]
        where = f"{path}, line {1 + depths.index(max(depths))}"
        raise InputError(where, "lists in lists without end", "at most a few", "mend that line", code="E020") from error


def _text(path: Path) -> str:
    wanted = "a pipeline file (TOML)"
    try:
        if path.exists() and not path.is_file():
            raise InputError(str(path), "a folder, a pipe or a device", wanted, "name the file itself", code="E003")
        return path.read_text(encoding="utf-8-sig")
    except FileNotFoundError as error:
        mend = 'check the path, or write a new pipeline with "pneucli init"'
        raise InputError(str(path), "cannot be read: no such file", wanted, mend, code="E002") from error
    except OSError as error:
        raise InputError(
            str(path), f"cannot be read: {error.strerror}", wanted, "check the path", code="E003"
        ) from error
    except UnicodeDecodeError as error:
        where = f"{path}, line {1 + error.object.count(10, 0, error.start)}"
        raise InputError(
            where, f"not UTF-8 at byte {error.start}", "UTF-8 text", "save the file as UTF-8", code="E004"
        ) from error
