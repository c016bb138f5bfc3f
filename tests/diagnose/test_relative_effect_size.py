"""How large an effect is as fitted, over what is plausible."""

import math
from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import pytest

from pneucli.diagnose.evidence import relative_effect_size
from pneucli.identify.estimation.fit import Estimate
from pneucli.physics.declaration import Effect
from pneucli.physics.effects import catalogue
from pneucli.simulate.rig_quantities import rig_quantities
from tests.simulate.synthetic_experiments import model

FACTS = replace(rig_quantities(model()), coulomb=10.0)


def size(effect: Effect, base: dict[str, float] | None = None, **values: float) -> float:
    """The magnitude of an effect with these values as fitted."""
    names = {f"{effect.name}.{name}": value for name, value in values.items()}
    estimates = [Estimate(name, "", value, 0.1, (0.0, 0.0), False) for name, value in names.items()]
    fitted: Any = SimpleNamespace(estimates=estimates, model=model([effect.name], (base or {}) | names))
    return relative_effect_size(fitted, effect, FACTS)


def test_a_size_from_a_null_of_zero_is_relative_to_the_typical_value() -> None:
    """Of 2 % of the supply's force, either way."""
    assert size(catalogue()["constant-force"], force=-0.01 * FACTS.force) == pytest.approx(0.5)


def test_usual_is_the_middle_of_the_typical_values_by_factors() -> None:
    """Scales of 1.1 and 1.4, which are 0.1 and 0.4 from none, make 0.2; one that is none says nothing."""
    effect = catalogue()["pressure-scale"]
    effect = replace(effect, parameters=(replace(effect.parameters[0], typical=(1.1, 1.0, 1.4)),))
    assert size(effect, scale=1.3) == pytest.approx(1.5)
    assert size(effect, scale=0.9) == pytest.approx(0.5)


def test_one_that_vanishes_at_infinity_is_the_larger_the_smaller_its_parameter() -> None:
    """Seals that give way by 0.5 and by 0.02 mm under Coulomb friction are typical."""
    usual = FACTS.coulomb / math.sqrt(0.5e-3 * 0.02e-3)
    assert size(catalogue()["presliding"], stiffness=0.5 * usual, damping=80.0) == pytest.approx(2.0)


def test_one_that_vanishes_at_a_base_parameter_counts_from_there() -> None:
    """Coulomb friction is 12 N; 1.3 and 1.8 times 10 N are typical, 1 N and 6 N from there."""
    found = size(catalogue()["stribeck"], {"friction.coulomb": 12.0}, static=14.0, velocity=0.01)
    assert found == pytest.approx(2.0 / math.sqrt(6.0))


def test_of_several_parameters_the_farthest_counts_each_way() -> None:
    """0.2 either way is typical."""
    found = size(catalogue()["friction-asymmetry"], asymmetry=0.1, viscous_asymmetry=-0.3)
    assert found == pytest.approx(0.3 / 0.2)


def test_of_one_that_no_value_makes_absent_the_size_says_nothing() -> None:
    assert size(catalogue()["heat-transfer"], conductance=0.6) == 1.0
