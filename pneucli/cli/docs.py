"""Write the pages that are generated from the program: ``python -m pneucli.cli.docs DOCS`` (``make docs``)."""

import ast
import re
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import typer

from pneucli.cli.commands import effects, explain, schema
from pneucli.cli.program import EXIT_CODES, build

PACKAGES = ("diagnose", "identify")
PAGE_HEAD = """# Constants of identification and diagnosis

Made by `make docs` from the source: each constant, its value, and its comment. This reference table is longer
than other pages. [Inside the program](internals.md) explains where they act, [The method](../method.md) what for.

| constant | value | comment |
| --- | --- | --- |
"""
DOCS = Path(__file__).parents[2] / "docs"
HEAD = """# The command line

A reference of every command, longer than other pages. Made by `make docs` from the commands themselves; a test compares
both. `pneucli COMMAND --help` prints the same.
"""


def constants_page() -> str:
    """Return the page."""
    package = Path(__file__).parents[1]
    files = sorted(file for name in PACKAGES for file in (package / name).rglob("*.py"))
    rows = [
        f"| `{'.'.join(file.relative_to(package).with_suffix('').parts)}.{name}` | {value} | {comment} |"
        for file in files
        for name, value, comment in _constants(file.read_text(encoding="utf-8"))
    ]
    return PAGE_HEAD + "\n".join(rows) + "\n"


def _constants(source: str) -> Iterator[tuple[str, str, str]]:
    """Yield name, value and comment of each constant number at the top of a module."""
    lines = source.splitlines()
    for node in ast.parse(source).body:
        if isinstance(node, ast.Assign) and (comment := _comment(lines, node)):
            for name, value in _pairs(node):
                if name.isupper():
                    yield name, value, comment.replace("|", "\\|")


def _pairs(node: ast.Assign) -> Iterator[tuple[str, str]]:
    target, value = node.targets[0], node.value
    pairs = [(target, value)]
    if isinstance(target, ast.Tuple) and isinstance(value, ast.Tuple):
        pairs = list(zip(target.elts, value.elts, strict=True))
    for name, number in pairs:
        if isinstance(name, ast.Name) and isinstance(number, ast.Constant) and isinstance(number.value, int | float):
            yield name.id, ast.unparse(number)


def _comment(lines: list[str], node: ast.Assign) -> str:
    """Return the comment behind an assignment, or else the one above it."""
    line = lines[node.lineno - 1][node.end_col_offset :] if node.end_lineno == node.lineno else ""
    if trailing := re.match(r"\s*#\s*(.+)", line):
        return trailing[1]
    above: list[str] = []
    for text in reversed(lines[: node.lineno - 1]):
        if not text.startswith("#"):
            break
        above.insert(0, text.lstrip("# "))
    return " ".join(above)


def command_line_page() -> str:
    """Return the reference of the command line: the program, then each command with its arguments and options."""
    program: Any = typer.main.get_command(build())
    pages = [_page(f"pneucli {name}", command) for name, command in program.commands.items()]
    return "\n".join([HEAD, _page("pneucli", program), *pages, f"{EXIT_CODES}\n"])


def generated_pages() -> dict[str, str]:
    """Return every generated page, by its path below ``docs``."""
    from pneucli.config.key_reference import schema_text
    from pneucli.physics.effects import catalogue

    all_effects = [effect for _, effect in sorted(catalogue().items())]
    made = {
        "cli.md": command_line_page(),
        "errors.md": explain.errors_page(),
        "effects.md": effects.index_page(all_effects),
        "pipeline-file.md": schema.keys_page(),
    }
    made |= {
        "pipeline.schema.json": schema_text(),
        "own-effect.md": _own_effect(),
        "raw-files.md": _with_made("raw-files.md", "formats", formats_table()),
        "data-checks.md": _with_made("data-checks.md", "detectors", detectors_table()),
        "development/extend.md": _extend(),
        "development/constants.md": constants_page(),
    }
    return made | {f"effects/{effect.name}.md": effects.effect_page(effect) for effect in all_effects}


def _own_effect() -> str:
    """Return the page on user-defined effects with the present example and table of ports."""
    text = (DOCS / "own-effect.md").read_text(encoding="utf-8")
    example = (DOCS / "examples" / "rod_wiper.py").read_text(encoding="utf-8")
    return replace_between_marks(
        replace_between_marks(text, "example", f"```python\n{example}```"), "ports", effects.ports_table()
    )


def _with_made(page: str, name: str, made: str) -> str:
    return replace_between_marks((DOCS / page).read_text(encoding="utf-8"), name, made)


def formats_table() -> str:
    """Return the table of the formats of raw files: what each declares."""
    from pneucli.io.formats import formats

    rows = [
        f"| {one.file} | {one.column} | {one.extra and f'`{one.extra}`'} | {one.used} | {one.unused} |"
        for one in sorted(formats(), key=lambda one: one.file.lower())
        if one.file
    ]
    head = ["| file | a column is | needs | used of what it says of its numbers | not used |", "| --- " * 5 + "|"]
    return "\n".join([*head, *rows])


def detectors_table() -> str:
    """Return the table of what the detectors of odd data say: each check, when it contradicts, and when it doubts."""
    from pneucli.plausibility.detectors import detectors

    said: dict[str, tuple[list[str], list[str]]] = {}
    for one in detectors():
        for check, (contradiction, doubt) in one.says.items():
            told = said.setdefault(check, ([], []))
            told[0].extend([contradiction] * bool(contradiction))
            told[1].extend([doubt] * bool(doubt))
    rows = [f"| `{check}` | {'; '.join(told[0])} | {'; '.join(told[1])} |" for check, told in said.items()]
    return "\n".join(["| check | contradiction if | doubt if |", "| --- | --- | --- |", *rows])


def _extend() -> str:
    """Return the page on extensions with the present examples."""
    text = (DOCS / "development" / "extend.md").read_text(encoding="utf-8")
    for name in re.findall(r"<!-- made: (\w+\.py) -->", text):
        example = (DOCS / "examples" / name).read_text(encoding="utf-8")
        text = replace_between_marks(text, name, f"```python\n{example}```")
    return text


def replace_between_marks(text: str, name: str, made: str) -> str:
    """Return a page with the text between two marks replaced."""
    begin, end = f"<!-- made: {name} -->\n\n", f"\n\n<!-- end of {name} -->"
    before, _, rest = text.partition(begin)
    return f"{before}{begin}{made}{end}{rest.partition(end)[2]}"


def effect_pictures() -> dict[str, str]:
    """Return every effect's picture (SVG), by its path below ``docs``."""
    from pneucli.physics.effects import catalogue
    from pneucli.report.effect_figures import effect_figure

    return {f"effects/{name}.svg": effect_figure(effect) for name, effect in sorted(catalogue().items())}


def _page(title: str, command: Any) -> str:
    arguments = [p for p in command.params if p.param_type_name == "argument"]
    usage = " ".join([title, *(a.metavar if a.required else f"[{a.metavar}]" for a in arguments)])
    rows = [f"- `{_flags(p)}`: {p.help}" for p in command.params if p.help]
    return "\n".join([f"## `{usage}`", "", command.help, "", *rows, ""])


def _flags(parameter: Any) -> str:
    if parameter.param_type_name == "argument":
        return str(parameter.metavar)
    return " ".join(
        [", ".join([*parameter.opts, *parameter.secondary_opts]), *([parameter.metavar] if parameter.metavar else [])]
    )


def main(docs: Path) -> None:
    """Write all pages and pictures into the folder ``docs``."""
    (docs / "effects").mkdir(exist_ok=True)
    for name, text in (generated_pages() | effect_pictures()).items():
        (docs / name).write_text(text, encoding="utf-8")


if __name__ == "__main__":
    main(Path(sys.argv[1]))
