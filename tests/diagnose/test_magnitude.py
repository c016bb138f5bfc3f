"""How large an effect is as fitted, over its error and over what is plausible."""

from __future__ import annotations

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


def typical(effect: str, parameter: str) -> float:
    declared = next(p for p in catalogue()[effect].parameters if p.name == parameter)
    return max(abs(one) for one in declared.on(FACTS).typical)


def test_an_effect_that_vanishes_at_nothing_stands_over_its_error_and_its_typical_value() -> None:
    usual = typical("constant-force", "force")
    size = magnitude(found(("constant-force.force", -0.5 * usual, 0.1 * usual)), catalogue()["constant-force"], FACTS)
    assert size == pytest.approx((5.0, 0.5))


def test_one_that_vanishes_at_infinity_is_the_larger_the_smaller_its_parameter() -> None:
    usual = min(catalogue()["presliding"].parameters[0].on(FACTS).typical)
    fitted = found(("presliding.stiffness", 0.5 * usual, 0.1 * usual), ("presliding.damping", 80.0, 1.0))
    assert magnitude(fitted, catalogue()["presliding"], FACTS) == pytest.approx((5.0, 2.0))


def test_one_that_vanishes_at_a_base_parameter_counts_from_there() -> None:
    """Coulomb friction is 14 N; 1.8 times 10 N is usual."""
    fitted = found(("stribeck.static", 16.0, 0.5), ("stribeck.velocity", 0.01, 0.1), **{"friction.coulomb": 14.0})
    assert magnitude(fitted, catalogue()["stribeck"], FACTS) == pytest.approx((4.0, 2.0 / 4.0))


def test_of_several_parameters_the_farthest_counts_each_way() -> None:
    fitted = found(("friction-asymmetry.asymmetry", 0.1, 0.05), ("friction-asymmetry.viscous_asymmetry", -0.3, 0.1))
    usual = typical("friction-asymmetry", "viscous_asymmetry")
    assert magnitude(fitted, catalogue()["friction-asymmetry"], FACTS) == pytest.approx((3.0, 0.3 / usual))


def test_of_one_that_no_value_makes_absent_the_size_says_nothing() -> None:
    fitted = found(("heat-transfer.conductance", 0.6, 0.1))
    assert magnitude(fitted, catalogue()["heat-transfer"], FACTS) == pytest.approx((6.0, 1.0))
