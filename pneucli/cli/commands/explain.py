"""``explain``: what a code of a fault means; the same texts make the page ``docs/errors.md``."""

import tomllib
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, field
from functools import cache
from importlib.resources import files
from typing import Annotated, Any

import typer

from pneucli.cli import console
from pneucli.cli.command import Command, How
from pneucli.errors import InputError, did_you_mean
from pneucli.figure import flat, read


@dataclass(frozen=True)
class Example:
    """How a fault arises: base files, one replacement in them, further files, and what is run.

    Attributes:
        command: The command that fails; empty where ``python`` fails.
        python: The Python code that fails.
        output: What the program prints, in a folder of its own.
        change: A text of the base files, and what stands in its place.
        files: Further files by their path; they replace those of the base.
        zip: Archives by their path, with the files that they contain.
        encoding: The encoding of the pipeline file.
        without: Packages that are not installed.

    """

    command: str = ""
    python: str = ""
    output: str = ""
    change: Sequence[str] = ()
    files: Mapping[str, str] = field(default_factory=dict)
    zip: Mapping[str, Sequence[str]] = field(default_factory=dict)
    encoding: str = "utf-8"
    without: Sequence[str] = ()


@dataclass(frozen=True)
class FaultKind:
    """One kind of fault: what is found, and the mend."""

    code: str
    title: str
    found: str
    mend: str
    example: Example = field(metadata=flat())


@cache
def _document() -> dict[str, Any]:
    return tomllib.loads(files("pneucli").joinpath("fault_kinds.toml").read_text(encoding="utf-8"))


def base_files() -> dict[str, str]:
    """Return the files from which every example starts."""
    return {name: text.lstrip("\n") for name, text in _document()["base"].items()}


def fault_kinds() -> dict[str, FaultKind]:
    """Return every kind by its code."""
    return {code: read(FaultKind, {"code": code, **entry}) for code, entry in _document().items() if code != "base"}


HELP = "What the code of an error means, its mend, and an example."
MAX_SHOWN_LINES = 12  # of a file on the page
HEAD = """# Errors

A reference of every kind of fault that you can mend, longer than other pages. Made by `make docs`; `pneucli explain
E042` prints the same. An error states place, what was found, what is wanted and the mend, and ends its first line with
its code:

```text
error: bench.toml, line 6, key rig.suply_pressure: unknown key [E021]
  mend: did you mean "supply_pressure"?
```

The exit code is 2. Under `--json` the error is an object with `where`, `found`, `wanted`, `mend` and `code`. A code
stays with its kind in later versions; texts may change. Each example below is run by the tests. It changes or adds what
it shows to a pipeline of one recording:

"""


def _explain(
    code: Annotated[str | None, typer.Argument(metavar="CODE", help="Such as E042; default: all codes.")] = None,
    how: How = How(),
) -> None:
    kinds = fault_kinds()
    if code is not None and code.upper() not in kinds:
        raise InputError("explain", f'no code "{code}"', mend=did_you_mean(code.upper(), kinds), code="E031")
    chosen = list(kinds.values()) if code is None else [kinds[code.upper()]]
    if how.json:
        console.print_json({"schema": "pneucli/explain/1", "kinds": [asdict(kind) for kind in chosen]})
    elif code is None:
        for kind in chosen:
            console.print_text(f"{kind.code}  {kind.title}")
            if how.verbose:
                console.print_text(f"      {kind.found}\n      {kind.mend}")
    else:
        console.print_text(_text(chosen[0]))


def _text(kind: FaultKind) -> str:
    run = kind.example.command or kind.example.python
    return "\n".join(
        [f"{kind.code}: {kind.title}", "", kind.found, "", f"Mend: {kind.mend}", "", f"$ {run}", kind.example.output]
    )


def errors_page() -> str:
    """Return the page of all kinds in Markdown."""
    base = [f"`{name}`:\n\n{_block(name, text)}" for name, text in base_files().items()]
    return HEAD + "\n".join([*base, *(_section(kind) for kind in fault_kinds().values())])


def _section(kind: FaultKind) -> str:
    parts = [f"## {kind.code}: {kind.title}\n", f"{kind.found}\n", f"**Mend.** {kind.mend}\n"]
    return "\n".join([*parts, *_shown_files(kind.example), _run(kind.example)])


def _shown_files(example: Example) -> list[str]:
    parts = [f"With packages missing: {', '.join(example.without)}.\n"] if example.without else []
    if example.change:
        old, new = example.change
        parts.append(
            f"`{old}` becomes\n\n{_block('.toml' if '=' in new else '', new)}" if new else f"Without `{old}`.\n"
        )
    for name, text in example.files.items():
        parts.append(f"`{name}`{':' if text else ' is empty.'}\n" + (f"\n{_block(name, text)}" if text else ""))
    return parts


def _block(name: str, text: str) -> str:
    lines = text.splitlines()
    more = ["..."] if len(lines) > MAX_SHOWN_LINES and not name.endswith(".toml") else []
    shown = lines[:MAX_SHOWN_LINES] if more else lines
    return "\n".join(["```text", *shown, *more, "```", ""])


def _run(example: Example) -> str:
    command: Any = f"$ {example.command}" if example.command else f">>> {example.python}"
    return "\n".join(["```console", command, example.output, "```", ""])


COMMAND = Command(_explain, "pneucli explain E042", HELP, place=240)
