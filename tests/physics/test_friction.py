"""Properties of Stribeck friction; the effect and the vectorised function agree."""

from __future__ import annotations

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from pneucli.physics.effects import catalogue
from pneucli.physics.vectorised import stribeck_friction

V = np.linspace(-0.5, 0.5, 1001)
FORCE, SPEED = st.floats(1.0, 100.0), st.floats(1e-3, 0.1)


@given(coulomb=FORCE, viscous=FORCE, velocity=SPEED)
def test_without_a_rise_friction_is_odd_and_affine_beyond_rest(coulomb: float, viscous: float, velocity: float) -> None:
    for law in (
        stribeck_friction(V, coulomb, viscous, coulomb),
        stribeck_friction(V, coulomb, viscous, coulomb, velocity),
    ):
        assert np.allclose(law, -law[::-1], rtol=0, atol=1e-12)
        assert np.allclose(law[V > 0], coulomb + viscous * V[V > 0])
        assert law[V == 0] == 0.0


@given(coulomb=FORCE, rise=FORCE, viscous=FORCE, velocity=SPEED)
def test_stribeck_friction_falls_from_static_to_coulomb(
    coulomb: float, rise: float, viscous: float, velocity: float
) -> None:
    static = coulomb + rise
    dry = stribeck_friction(V, coulomb, viscous, static, velocity) - viscous * V
    slow, at_it, fast = stribeck_friction(velocity * np.array([1e-6, 1.0, 1e3]), coulomb, 0.0, static, velocity)
    assert np.allclose([slow, at_it, fast], [static, coulomb + 0.5 * rise, coulomb], rtol=1e-3, atol=1e-5 * rise)
    assert np.all(np.diff(dry[V > 0]) <= 1e-9)


def test_the_effect_stribeck_equals_equation_3_6() -> None:
    rise = catalogue()["stribeck"].ports["dry_rise"]
    law = stribeck_friction(V[V > 0], 14.0, 0.0, 22.0, 0.015)
    assert np.allclose([14.0 + rise(14.0, v, 22.0, 0.015) for v in V[V > 0]], law)
    assert np.allclose(14.0 + 8.0 / (1.0 + (V[V > 0] / 0.015) ** 2), law)


@given(v=st.floats(-2, 2), coulomb=FORCE, viscous=FORCE, rise=st.floats(0, 100), velocity=SPEED)
def test_friction_adds_no_energy(v: float, coulomb: float, viscous: float, rise: float, velocity: float) -> None:
    assert (stribeck_friction(np.array([v]), coulomb, viscous, coulomb + rise, velocity) * v)[0] >= 0.0
