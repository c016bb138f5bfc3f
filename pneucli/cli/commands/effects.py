"""``effects``: the catalogue as a list, or one effect; the same texts make the pages ``docs/effects/*.md``."""

from __future__ import annotations

import math
import re
import unicodedata
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from pneucli.cli import console
from pneucli.cli.command import Command, How
from pneucli.messages.formatting import format_plain

if TYPE_CHECKING:
    from pneucli.physics.declaration import Effect, Parameter
    from pneucli.physics.scales import Quantity


_SYMBOLS = {
    **{
        "kappa": "κ",
        "tau": "τ",
        "sigma": "σ",
        "pi": "π",
        "Psi": "Ψ",
        "Delta": "Δ",
        "mu": "µ",
        "rho": "ρ",
        "alpha": "α",
    },
    **{"beta": "β", "omega": "ω", "theta": "θ", "phi": "φ", "lambda": "λ", "eta": "η", "ell": "ℓ", "dots": "…"},
    **{"le": "≤", "ge": "≥", "leftarrow": "←", "cdot": "·", "times": "×", "infty": "∞", "left": "", "right": ""},
}
_SPACES = {",": " ", ";": " ", " ": " ", "!": "", "quad": "  "}
_RAISED = str.maketrans("0123456789+-", "⁰¹²³⁴⁵⁶⁷⁸⁹⁺⁻")
_DOTS = {"dot": "\u0307", "ddot": "\u0308", "hat": "\u0302", "bar": "\u0304"}  # combining marks
_TOKEN = re.compile(r"\\([A-Za-z]+|.)|([{}_^])|([^\\{}_^]+)")


INDEX_HEAD = """# The catalogue of effects

You look an effect up: one that the diagnosis names, or one whose [picture](#pictures) resembles your residual. Each
page says how the effect changes the residual, what it is taken for, and which experiment distinguishes them. `make
docs` makes the pages from the declarations in `pneucli/physics/effects`; `pneucli effects EFFECT` prints the same.

| effect | description | part | parameters | visible over | confounders |
| --- | --- | --- | --- | --- | --- |
"""
INDEX_TAIL = """
An effect of chamber 1, its hose or its sensor acts on chamber 2 as well: `NAME:2` (`"chamber-leak:2"`,
`"dead-volume:2"`, `"pressure-offset:2"`), with the same equations and parameters. An effect that both sides share may
be split: `"line-delay:1"`, `"pressure-scale:1"`. `diagnose` tries either side where both chambers are shut or both
sensors recorded.

[An effect of your own](own-effect.md) is the same declaration in a Python file that the pipeline file names
(`[model] plugins`); `pneucli effects PIPELINE` lists it, too.

## Sizes

Bounds, typical values (from which a fit starts) and steps are plain numbers in the parameter's unit, or numbers of a
scale, so they fit a bore of 6 mm at 3 bar as well as one of 200 mm at 50 bar:

```python
Parameter("force", "N", 0.0, "-10 supply forces", "10 supply forces", ("0.02 supply forces",), "force toward x = 0")
```

A scale follows from `[rig]`, the recordings and the fitted model. Where these do not determine it, `diagnose` skips the
effect, and `identify` refuses it by name. The base model's parameters have sizes of the same kind
(`pneucli/physics/declaration.py`).

| scale | unit | definition |
| --- | --- | --- |
"""
PICTURES = """
## Pictures

Left: a rig with the effect at a typical size, and the model without it. Right: the difference. No parameter is
refitted; a fit would absorb a part of it.
"""
PICTURE_CAPTION = """Left: the most sensitive channel, on a rig with the effect (at a typical size) and by the model
without it, restarted every 0.5 s. Right: the difference. No parameter is refitted; a fit would absorb a part of it."""
THESIS_REFERENCE = (
    "; the thesis is K. Széll, Direct Modeling and Robust Control of a Servo-pneumatic System, PhD thesis, Budapest "
    "University of Technology and Economics, 2015"
)
COLUMNS = ("parameter", "unit", "what", "absent at", "bounds", "typical")


HELP = "The catalogue of physical effects, or one of them at length; with a pipeline file its plugins too."


def _effects(
    first: Annotated[
        str | None, typer.Argument(metavar="PIPELINE", help="A pipeline file, for effects of its plugins.")
    ] = None,
    second: Annotated[str | None, typer.Argument(metavar="EFFECT", help="Its name.")] = None,
    how: How = How(),
) -> None:
    from pneucli.physics.effects import all_effects, select_effects

    pipeline, effect = (first, second) if second is not None or (first or "").endswith(".toml") else (None, first)
    available = all_effects(_plugins(Path(pipeline)) if pipeline else ())
    chosen = list(available.values()) if effect is None else list(select_effects([effect], available, "effects"))
    if how.json:
        console.print_json({"schema": "pneucli/effects/1", "effects": [_content(one) for one in chosen]})
    elif effect is None:
        for one in chosen:
            parameters = ", ".join(f"{p.name} ({p.unit})" for p in one.parameters)
            print(f"{one.name:20} {one.part:13} {parameters}")
            if how.verbose:
                print(f"{'':20} {one.title}: {plain_equation(one.equation)}")
    else:
        print(_text(chosen[0]))


def _plugins(pipeline: Path) -> list[Path]:
    """Return the Python files that a pipeline file names."""
    from pneucli.config import load, plugin_files

    return plugin_files(load(pipeline))


def effect_page(effect: Effect) -> str:
    """Return the effect's page in Markdown; its picture is in the same folder."""
    lines = [f"# {effect.title}", "", f"`{effect.name}`, part: {effect.part}", "", effect.equation, ""]
    lines += [f"| {' | '.join(COLUMNS)} |", "| --- " * len(COLUMNS) + "|"]
    lines += [f"| {' | '.join(_row(p))} |" for p in effect.parameters]
    lines += ["", f"![What it looks like]({effect.name}.svg)", "", PICTURE_CAPTION]
    for heading, text in _description(effect, [f"[{name}]({name}.md)" for name in effect.twins]):
        lines += ["", f"## {heading}", "", text]
    return "\n".join([*lines, "", "[All effects](../effects.md)", ""])


def index_page(effects: Sequence[Effect]) -> str:
    """Return the page of all effects with their pictures in Markdown."""
    from pneucli.physics.scales import SCALES

    rows = [
        f"| [{e.name}](effects/{e.name}.md) | {e.title} | {e.part} | "
        f"{', '.join(f'{p.name} ({p.unit})' for p in e.parameters)} | {e.shows_over} | {', '.join(e.twins)} |"
        for e in effects
    ]
    scales = [f"| {s.name} | {s.unit} | {s.meaning} |" for s in SCALES.values()]
    pictures = [
        f"### [{e.title}](effects/{e.name}.md)\n\n{e.looks_like}\n\n![{e.title}](effects/{e.name}.svg)\n"
        for e in effects
    ]
    tables = INDEX_HEAD + "\n".join(rows) + "\n" + INDEX_TAIL + "\n".join(scales) + "\n"
    return tables + "\n".join([PICTURES, *pictures])


def ports_table() -> str:
    """Return the table of all ports in Markdown."""
    from pneucli.physics.ports import PORTS

    rows = [
        f"| `{n}` | {', '.join(f'`{a}`' for a in p.arguments)} | {p.combine} | {p.meaning} |" for n, p in PORTS.items()
    ]
    return "\n".join(["| port | arguments | combined as | what it is |", "| --- | --- | --- | --- |", *rows])


def _row(parameter: Parameter) -> tuple[str, ...]:
    p = parameter
    absent = "∞" if p.null == math.inf else "-" if p.null is None else _together((p.null,), "")
    bounds = _together((p.lower, p.upper), " to ")
    return (p.name, p.unit, p.title, absent, bounds, _together(p.typical, ", "))


def _together(quantities: Sequence[Quantity], between: str) -> str:
    """Return quantities, with a common scale named once."""
    parts = [q if isinstance(q, str) else format_plain(q) for q in quantities]
    scales = [part.partition(" ")[2] for part in parts]
    return between.join(
        part.partition(" ")[0] if scale == following else part
        for part, scale, following in zip(parts, scales, [*scales[1:], ""], strict=True)
    )


def _description(effect: Effect, confounders: Sequence[str]) -> list[tuple[str, str]]:
    """Return headings and paragraphs; ``confounders`` are their names as they are to be shown."""
    from pneucli.physics.ports import PORTS

    ports = "; ".join(f"{port} ({PORTS[port].meaning})" for port in effect.ports)
    story = [
        ("In a residual", f"{effect.looks_like} Seen best over: {effect.shows_over}."),
        ("Easily taken for", ", ".join(confounders) or "nothing else in the catalogue"),
        ("How to distinguish them" if effect.twins else "How to verify it", effect.separate),
        ("Where it enters the model", f"{ports}."),
        ("Source", effect.source + (THESIS_REFERENCE if "thesis" in effect.source else "")),
    ]
    if not effect.nested:
        story.insert(0, ("Not nested", "No value of its parameters gives the model without it; it is there or not."))
    if others := _effects_without_null(effect):
        text = (
            f"Together with {others}, no value of its parameters gives the model without it: it is compared on and off."
        )
        story.insert(0, ("Present at its null", text))
    if effect.needs:
        story.append(("Needs", f"A recording of {', '.join(effect.needs)}."))
    return story


def _effects_without_null(effect: Effect) -> str:
    """Return the effects of the catalogue together with which this one acts even at its null."""
    from pneucli.physics.effects import catalogue

    return ", ".join(name for name, other in catalogue().items() if effect.in_model_with((other,)) is not effect)


def _text(effect: Effect) -> str:
    rows = [COLUMNS, *(_row(p) for p in effect.parameters)]
    widths = [max(len(row[i]) for row in rows) for i in range(len(COLUMNS))]
    table = ["  ".join(cell.ljust(w) for cell, w in zip(row, widths, strict=True)).rstrip() for row in rows]
    story = [f"{heading}: {text}" for heading, text in _description(effect, effect.twins)]
    return "\n".join(
        [
            f"{effect.name}: {effect.title} (part: {effect.part})",
            "",
            plain_equation(effect.equation),
            "",
            *table,
            "",
            *story,
        ]
    )


def _content(effect: Effect) -> dict[str, Any]:
    keys = ("name", "title", "part", "equation", "looks_like", "shows_over", "separate", "source")
    parameters = [
        {"name": p.name, "unit": p.unit, "null": None if p.null == math.inf else p.null}
        | {"lower": p.lower, "upper": p.upper, "title": p.title}
        for p in effect.parameters
    ]
    return {key: getattr(effect, key) for key in keys} | {"twins": list(effect.twins), "parameters": parameters}


def plain_equation(text: str) -> str:
    r"""Return an equation between dollar signs, and the words around it, without LaTeX.

    A command that is not known is named as it is, without its backslash.

    >>> plain_equation(r"$\tau \dot s = u - s$, the opening follows $s$")
    'τ ṡ = u - s, the opening follows s'
    >>> plain_equation(r"$\frac{\kappa R T}{V_b}\left(G (p_{set} - p_S) - q\right)$")
    '(κ R T)/V_b (G (p_set - p_S) - q)'
    """
    found = "".join(part if n % 2 == 0 else _converted(part) for n, part in enumerate(text.split("$")))
    found = re.sub(r" {2,}", " ", found)
    return re.sub(r"([(\[]) | (?=[,;.)\]])", r"\1", found).strip()


def _converted(latex: str) -> str:
    tokens = [match.group(0) for match in _TOKEN.finditer(latex)]
    return unicodedata.normalize("NFC", "".join(_sequence(tokens)))


def _sequence(tokens: list[str]) -> list[str]:
    """Consume tokens up to a closing brace, or all; return their text in parts."""
    parts: list[str] = []
    while tokens and tokens[0] != "}":
        parts.append(_next_part(tokens))
    return parts


def _next_part(tokens: list[str]) -> str:
    token = tokens.pop(0)
    if token in "_^":
        return f"_{_argument(tokens)}" if token == "_" else _power(_argument(tokens))
    if token == "{":
        inside = "".join(_sequence(tokens))
        tokens[:1] = []
        return inside
    return _command(token[1:], tokens) if token.startswith("\\") else token


def _command(name: str, tokens: list[str]) -> str:
    if name == "frac":
        above, below = _argument(tokens), _argument(tokens)
        return f"{_in_brackets(above)}/{_in_brackets(below)} "
    if name == "sqrt":
        return f"√({_argument(tokens)})"
    if name in _DOTS:
        letter = _argument(tokens)
        return f"{letter[:1]}{_DOTS[name]}{letter[1:]}"
    if name in ("mathrm", "text", "operatorname", "mathit"):
        return _argument(tokens)
    return _SPACES.get(name, _SYMBOLS.get(name, name))


def _argument(tokens: list[str]) -> str:
    """Consume the group, the command or the one character that a command is for."""
    while tokens and not tokens[0].strip():
        tokens.pop(0)
    if not tokens:
        return ""
    if tokens[0] == "{" or tokens[0].startswith("\\"):
        return _next_part(tokens)
    text = tokens.pop(0).lstrip()
    tokens[:0] = [text[1:]] if text[1:] else []
    return text[0]


def _power(exponent: str) -> str:
    return exponent.translate(_RAISED) if re.fullmatch(r"[+-]?\d+", exponent) else f"^({exponent})"


def _in_brackets(term: str) -> str:
    return f"({term})" if re.search(r"[ +\-/]", term.strip()) else term


COMMAND = Command(_effects, "pneucli effects friction-hysteresis", HELP, place=200)
