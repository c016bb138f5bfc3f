"""The friction laws 3.1-3.7 by what defines them."""

from __future__ import annotations

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from pneucli.physics import friction
from pneucli.physics.effects import catalogue

V = np.linspace(-0.5, 0.5, 1001)
FORCE, SPEED = st.floats(1.0, 100.0), st.floats(1e-3, 0.1)


@given(coulomb=FORCE, viscous=FORCE)
def test_coulomb_and_viscous_friction_are_odd_and_affine_beyond_rest(coulomb: float, viscous: float) -> None:
    f = friction.coulomb_viscous(V, coulomb, viscous)
    assert np.allclose(f, -f[::-1], rtol=0, atol=1e-12)
    assert np.allclose(f[V > 0], coulomb + viscous * V[V > 0])
    assert np.array_equal(friction.coulomb(V, coulomb), friction.coulomb_viscous(V, coulomb, 0.0))


@given(coulomb=FORCE, rise=FORCE, viscous=FORCE, velocity=SPEED)
def test_stribeck_friction_falls_from_static_to_coulomb(coulomb, rise, viscous, velocity) -> None:
    static = coulomb + rise
    for law in (friction.stribeck, friction.stribeck_exponential):
        dry = law(V, coulomb, viscous, static, velocity) - viscous * V
        slow, fast = np.array([1e-9]), np.array([1e3 * velocity])
        assert np.allclose(law(slow, coulomb, 0.0, static, velocity), static, rtol=1e-6)
        assert np.allclose(law(fast, coulomb, 0.0, static, velocity), coulomb, rtol=1e-3, atol=1e-5 * rise)
        assert np.all(np.diff(dry[V > 0]) <= 1e-9)
    half = friction.stribeck(np.array([velocity]), coulomb, 0.0, static, velocity)  # (3.6): half the rise at v_s
    assert np.allclose(half, coulomb + 0.5 * rise)


def test_the_effect_stribeck_is_law_3_6() -> None:
    rise = catalogue()["stribeck"].ports["dry_rise"]
    law = friction.stribeck(V[V > 0], 14.0, 0.0, 22.0, 0.015)
    assert np.allclose([14.0 + rise(14.0, v, 22.0, 0.015) for v in V[V > 0]], law)


def test_nouris_hysteresis_takes_one_law_speeding_up_and_another_slowing() -> None:
    a = np.where(V > 0, 1.0, -1.0)
    rising = friction.nouri(V, a, (14.0, 45.0, 22.0, 0.015), (8.0, 30.0))
    slowing = friction.nouri(V, -a, (14.0, 45.0, 22.0, 0.015), (8.0, 30.0))
    assert np.array_equal(rising, friction.stribeck(V, 14.0, 45.0, 22.0, 0.015))
    assert np.array_equal(slowing[V != 0], friction.coulomb_viscous(V, 8.0, 30.0)[V != 0])


@given(v=st.floats(-2, 2), coulomb=FORCE, viscous=FORCE, rise=st.floats(0, 100), velocity=SPEED)
def test_no_law_adds_energy(v, coulomb, viscous, rise, velocity) -> None:
    at = np.array([v])
    laws = (
        friction.coulomb_viscous(at, coulomb, viscous),
        friction.stribeck(at, coulomb, viscous, coulomb + rise, velocity),
        friction.stribeck_exponential(at, coulomb, viscous, coulomb + rise, velocity),
    )
    assert all((f * at)[0] >= 0.0 for f in laws)
