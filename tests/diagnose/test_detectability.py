"""Effects that these recordings could not have shown are told, with that reason."""

from dataclasses import replace
from types import SimpleNamespace
from typing import Any

from pneucli.diagnose.candidate import Decision
from pneucli.diagnose.diagnosis import MinimumDetectableEffect, _first_decision_each, undetectable_effects
from pneucli.physics.effects import catalogue
from tests.diagnose.candidates import VIEW, candidate, diagnosis_data

KNOWN = catalogue()


def test_insensitive_and_implausible_effects_are_undetectable() -> None:
    deaf: Any = SimpleNamespace(**vars(VIEW) | {"is_sensitive_to": lambda effect: effect.name != "valve-lag"})
    names = ("valve-lag", "extra-mass", "stribeck")
    where = replace(diagnosis_data(), train=[deaf], effects={n: KNOWN[n] for n in names})
    sizes = [
        MinimumDetectableEffect(
            KNOWN["extra-mass"], KNOWN["extra-mass"].parameters[0], 90.0, plausible=False, typical=False
        ),
        MinimumDetectableEffect(KNOWN["stribeck"], KNOWN["stribeck"].parameters[0], 0.1, plausible=True, typical=True),
    ]
    found = undetectable_effects(where, sizes)
    assert {d.effect.name: d.reason for d in found} == {"valve-lag": "cannot-show", "extra-mass": "cannot-show"}


def test_cannot_show_precedes_the_screening_and_follows_a_fit() -> None:
    mass, lag = KNOWN["extra-mass"], KNOWN["valve-lag"]
    said = [
        Decision(mass, "not-promising"),
        Decision(lag, "vanishes", candidate("valve-lag")),
        Decision(mass, "cannot-show"),
        Decision(lag, "cannot-show"),
    ]
    assert {d.effect.name: d.reason for d in _first_decision_each(said)} == {
        "extra-mass": "cannot-show",
        "valve-lag": "vanishes",
    }
