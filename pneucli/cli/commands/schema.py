"""``schema``: the JSON schema of the pipeline file, and the page of all its keys."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import groupby
from typing import TYPE_CHECKING

from pneucli.cli.command import Command, How

if TYPE_CHECKING:
    from pneucli.config.key_reference import Key

HELP = "The JSON schema of the pipeline file, for editors that complete keys while one types."
HEAD = """# The pipeline file, key by key

A reference of every key, longer than other pages. Made by `make docs` from the models that check the file; a test
checks each example. One TOML file describes one piece of work. Quantities are texts with a unit (`"7 bar"`,
`"8.04 cm^2"`, `"0.5 s"`); a bare number is SI. Pressures are absolute inside; `"3 barg"`, or `reference = "gauge"` for
a column, count from `ambient_pressure`. Units read as labs write them: `m/s2`, `mm2`, `degC`, `psi`, `bar(g)`,
`l/min`. Paths are relative to the file, `${NAME}` is an environment variable, and `file` takes a glob. What is absent
is identified or assumed; [The rig](rig.md) says which.

**Editors.** The first line `#:schema ./pipeline.schema.json` lets editors with Taplo (VS Code's Even Better TOML,
Neovim, Zed) complete keys and mark what is misspelt. `pneucli init` writes the line and the schema;
`pneucli schema > pipeline.schema.json` writes it for a file that you have, and
[this site](pipeline.schema.json) has it, too.
"""
TABLES = {
    "recordings": ("[[recordings]]", "One for each recording, or a glob."),
    "recordings.more": ("[[recordings.more]]", "A further file of the same recording, with a clock of its own."),
    "signals.NAME": (
        "[signals]: one entry for each signal",
        "NAME is `time`, `u`, `u2`, `p_supply`, `p1`, `p2`, `x`, `v`, `a`, `force`, `temperature`, `flow`, `x_ref` or "
        '`p_ref`: `p1 = { column = "P1 [bar]", unit = "bar", reference = "gauge" }`.',
    ),
    "signals.NAME.where": ("where, of a signal", "Which rows of a long table belong to the signal."),
    "model.parameters.NAME": (
        "[model.parameters]: one entry for each parameter",
        'NAME is a parameter as `identify` names it: `"friction.viscous" = { fixed = "45 N s/m" }`.',
    ),
    "design": ("[design]", "Requirements of the controller; what is absent is derived from the model."),
    "scenarios, kind = open-loop": ('[[scenarios]] with kind = "open-loop"', "The model under a command."),
    "scenarios, kind = closed-loop": ('[[scenarios]] with kind = "closed-loop"', "The model and the controller."),
    "scenarios, kind = monte-carlo": ('[[scenarios]] with kind = "monte-carlo"', "Many axes that differ."),
    "checks.PATH": (
        "[checks]: one entry for each check",
        'PATH leads into a JSON answer: `"compare.error.test" = { max = 1.5 }`. What fails is exit code 1.',
    ),
}


def _schema(how: How = How(json=True)) -> None:
    """The options exist for uniformity: the answer is JSON, and there is nothing beside it."""
    from pneucli.config.key_reference import schema_text

    print(schema_text(), end="")


def keys_page() -> str:
    """Return the page of all keys in Markdown."""
    from pneucli.config.key_reference import all_keys

    parts = [HEAD]
    for table, own in groupby(all_keys(), key=lambda key: key.table):
        title, lead = TABLES.get(table, (f"[{table}]", ""))
        parts += [f"## {title}\n", *([lead + "\n"] if lead else []), _rows(list(own))]
    return "\n".join(parts)


def _rows(keys: Sequence[Key]) -> str:
    lines = ["| key | what it says | SI unit | default | example |", "| --- | --- | --- | --- | --- |"]
    for key in keys:
        name = f"`{key.name}`" + (" (required)" if key.required else "")
        says = key.says + (f": {', '.join(f'`{c}`' for c in key.choices)}" if key.choices else "")
        default = f"`{key.default}`" if key.default else ""
        shown = key.example.replace("|", "\\|")
        unit = "" if key.unit == "1" else key.unit
        example = f"`` {shown} ``" if "`" in shown else f"`{shown}`"
        lines.append(f"| {name} | {says} | {unit} | {default} | {example} |")
    return "\n".join(lines) + "\n"


COMMAND = Command(_schema, "pneucli schema > axis-7/pipeline.schema.json", HELP, place=230)
