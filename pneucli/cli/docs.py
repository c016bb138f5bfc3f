"""``docs/cli.md``, made from the commands themselves: ``python -m pneucli.cli.docs > docs/cli.md``."""

from __future__ import annotations

from typing import Any

import typer

from pneucli.cli.commands import EXIT_CODES, build

HEAD = """# The command line

Made by `make docs` from the commands themselves; a test holds it to them. `pneucli COMMAND --help` says the same.
"""


def render() -> str:
    """Return the page: the program, then each command with its arguments and options."""
    program: Any = typer.main.get_command(build())
    pages = [_page(f"pneucli {name}", command) for name, command in program.commands.items()]
    return "\n".join([HEAD, _page("pneucli", program), *pages, f"{EXIT_CODES}\n"])


def _page(title: str, command: Any) -> str:
    arguments = [p for p in command.params if p.param_type_name == "argument"]
    usage = " ".join([title, *(a.metavar if a.required else f"[{a.metavar}]" for a in arguments)])
    rows = [f"- `{_flags(p)}`: {p.help}" for p in command.params if p.help]
    return "\n".join([f"## `{usage}`", "", command.help, "", *rows, ""])


def _flags(parameter: Any) -> str:
    if parameter.param_type_name == "argument":
        return str(parameter.metavar)
    return " ".join([", ".join(parameter.opts), *([parameter.metavar] if parameter.metavar else [])])


if __name__ == "__main__":
    print(render(), end="")
