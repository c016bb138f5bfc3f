"""No LaTeX reaches a terminal."""

import pytest

from pneucli.cli.commands.effects import plain_equation
from pneucli.physics.effects import catalogue


@pytest.mark.parametrize("name", catalogue())
def test_the_equation_of_an_effect_is_plain_text(name: str) -> None:
    text = plain_equation(catalogue()[name].equation)
    assert not set(text) & set("\\${}")
    assert text.count("(") == text.count(")")


@pytest.mark.parametrize(
    ("latex", "plain"),
    [
        (r"$F = -c\,\frac{\ell - s}{\ell}\,v$ near an end", "F = -c (ℓ - s)/ℓ v near an end"),
        (r"$e^{-t/\tau}$, $x^2$, $a^{-1}$", "e^(-t/τ), x², a⁻¹"),
        (r"$\sqrt{2/(R T)}$", "√(2/(R T))"),
        (r"$\unknown{a}_{b}$", "unknowna_b"),
        ("no formula", "no formula"),
    ],
)
def test_commands_become_signs(latex: str, plain: str) -> None:
    assert plain_equation(latex) == plain
