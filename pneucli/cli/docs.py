"""The pages that are made from the program itself: ``python -m pneucli.cli.docs DOCS`` (``make docs``)."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Any

import typer

from pneucli.cli import effects
from pneucli.cli.commands import EXIT_CODES, build

HEAD = """# The command line

Made by `make docs` from the commands themselves; a test holds it to them. `pneucli COMMAND --help` says the same.
"""


def render() -> str:
    """Return the page: the program, then each command with its arguments and options."""
    program: Any = typer.main.get_command(build())
    pages = [_page(f"pneucli {name}", command) for name, command in program.commands.items()]
    return "\n".join([HEAD, _page("pneucli", program), *pages, f"{EXIT_CODES}\n"])


def pages() -> dict[str, str]:
    """Return every page that is made, by its path below ``docs``."""
    from pneucli.physics.effects import catalogue

    known = [effect for _, effect in sorted(catalogue().items())]
    made = {"cli.md": render(), "effects.md": effects.index(known)}
    return made | {f"effects/{effect.name}.md": effects.page(effect) for effect in known}


def pictures() -> dict[str, str]:
    """Return every effect's picture (SVG), by its path below ``docs``."""
    from pneucli.physics.effects import catalogue
    from pneucli.report.effects import picture

    return {f"effects/{name}.svg": picture(effect) for name, effect in sorted(catalogue().items())}


def _page(title: str, command: Any) -> str:
    arguments = [p for p in command.params if p.param_type_name == "argument"]
    usage = " ".join([title, *(a.metavar if a.required else f"[{a.metavar}]" for a in arguments)])
    rows = [f"- `{_flags(p)}`: {p.help}" for p in command.params if p.help]
    return "\n".join([f"## `{usage}`", "", command.help, "", *rows, ""])


def _flags(parameter: Any) -> str:
    if parameter.param_type_name == "argument":
        return str(parameter.metavar)
    return " ".join([", ".join(parameter.opts), *([parameter.metavar] if parameter.metavar else [])])


def main(docs: Path) -> None:
    """Write all pages and pictures into the folder ``docs``."""
    (docs / "effects").mkdir(exist_ok=True)
    for name, text in (pages() | pictures()).items():
        (docs / name).write_text(text, encoding="utf-8")


if __name__ == "__main__":
    main(Path(sys.argv[1]))
