"""The equations of effects for a terminal: their LaTeX as plain text."""

from __future__ import annotations

import re
import unicodedata

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
