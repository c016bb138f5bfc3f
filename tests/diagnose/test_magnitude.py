"""How large an effect is as fitted, over its error and over what is plausible."""

from __future__ import annotations

import math
from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import pytest

from pneucli.diagnose.magnitude import magnitude
from pneucli.identify.fit import Estimate
from pneucli.physics.effects import catalogue
from pneucli.simulate.facts import facts_of
from tests.simulate.benches import model

FACTS = replace(facts_of(model()), coulomb=10.0)


def found(*values: tuple[str, float, float], **base: float) -> Any:
    """A fit with parameters (name, value, error)."""
    estimates = [Estimate(name, "", value, error, (0.0, 0.0), False) for name, value, error in values]
    return SimpleNamespace(estimates=estimates, model=model(values=base or {}))


def test_an_effect_that_vanishes_at_nothing_stands_over_its_error_and_its_typical_value() -> None:
    """Of 2 % of the supply's force, either way."""
    usual = 0.02 * FACTS.force
    size = magnitude(found(("constant-force.force", -0.5 * usual, 0.1 * usual)), catalogue()["constant-force"], FACTS)
    assert size == pytest.approx((5.0, 0.5))


def test_usual_is_the_middle_of_the_typical_values_by_factors() -> None:
    """Scales of 1.1 and 1.4, which are 0.1 and 0.4 from none, make 0.2; one that is none says nothing."""
    effect = catalogue()["pressure-scale"]
    effect = replace(effect, parameters=(replace(effect.parameters[0], typical=(1.1, 1.0, 1.4)),))
    for scale, size in ((1.3, 1.5), (0.9, 0.5)):
        assert magnitude(found(("pressure-scale.scale", scale, 0.1)), effect, FACTS).over_usual == pytest.approx(size)


def test_one_that_vanishes_at_infinity_is_the_larger_the_smaller_its_parameter() -> None:
    """8 and 40 supply forces per stroke are typical."""
    usual = math.sqrt(8.0 * 40.0) * FACTS.force / FACTS.stroke
    fitted = found(("presliding.stiffness", 0.5 * usual, 0.1 * usual), ("presliding.damping", 80.0, 1.0))
    assert magnitude(fitted, catalogue()["presliding"], FACTS) == pytest.approx((5.0, 2.0))


def test_one_that_vanishes_at_a_base_parameter_counts_from_there() -> None:
    """Coulomb friction is 12 N; 1.3 and 1.8 times 10 N are typical, 1 N and 6 N from there."""
    fitted = found(("stribeck.static", 14.0, 0.5), ("stribeck.velocity", 0.01, 0.1), **{"friction.coulomb": 12.0})
    assert magnitude(fitted, catalogue()["stribeck"], FACTS) == pytest.approx((4.0, 2.0 / math.sqrt(6.0)))


def test_of_several_parameters_the_farthest_counts_each_way() -> None:
    """0.2 either way is typical."""
    fitted = found(("friction-asymmetry.asymmetry", 0.1, 0.05), ("friction-asymmetry.viscous_asymmetry", -0.3, 0.1))
    assert magnitude(fitted, catalogue()["friction-asymmetry"], FACTS) == pytest.approx((3.0, 0.3 / 0.2))


def test_of_one_that_no_value_makes_absent_the_size_says_nothing() -> None:
    fitted = found(("heat-transfer.conductance", 0.6, 0.1))
    assert magnitude(fitted, catalogue()["heat-transfer"], FACTS) == pytest.approx((6.0, 1.0))
