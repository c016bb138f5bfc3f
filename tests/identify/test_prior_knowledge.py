"""What is known of parameters beforehand: fixed, bounded, started, or held by a prior."""

from dataclasses import replace

import numpy as np
import pytest

from pneucli.identify.estimation.fit import fit
from pneucli.identify.estimation.parameters import base_parameters, effect_parameters, with_prior_knowledge
from pneucli.identify.estimation.score_test import initial_guesses
from pneucli.physics.effects import catalogue
from pneucli.recording import ParameterPrior, Rig
from pneucli.simulate.rig_quantities import rig_quantities
from tests.identify.test_fit import COULOMB, VISCOUS, Line
from tests.simulate.synthetic_experiments import BALANCED, RIG, VALVE, make_experiment, model, time_grid


def knowing(**known: ParameterPrior) -> Rig:
    return replace(RIG, priors={name.replace("__", "."): k for name, k in known.items()})


def test_what_is_fixed_is_not_free_and_no_change_of_the_model_moves_it() -> None:
    rig = knowing(friction__viscous=ParameterPrior("N s/m", fixed=30.0))
    assert with_prior_knowledge([COULOMB, VISCOUS], rig) == [COULOMB]
    fixed = model(rig=rig)
    assert fixed.values["friction.viscous"] == 30.0
    assert fixed.with_values({"friction.viscous": 99.0}).values["friction.viscous"] == 30.0


def test_an_area_of_the_valve_can_be_fixed() -> None:
    rig = replace(RIG, priors={"valve.effective_area(+5 V)": ParameterPrior("m^2", fixed=2e-6)})
    assert model(rig=rig).valve.parameters()["valve.effective_area(+5 V)"][0] == 2e-6
    assert model().valve.parameters()["valve.effective_area(+5 V)"][0] == VALVE.areas[2]


def test_bounds_hold_and_a_start_beyond_the_usual_ones_widens_them() -> None:
    (free,) = with_prior_knowledge([COULOMB], knowing(friction__coulomb=ParameterPrior("N", lower=12.0, upper=13.0)))
    assert (free.lower, free.start, free.upper) == (12.0, 12.0, 13.0)
    (wide,) = with_prior_knowledge([COULOMB], knowing(friction__coulomb=ParameterPrior("N", start=5e3)))
    assert wide.upper == 5e3


def test_a_prior_draws_the_estimate_by_its_weight_wherever_the_fit_starts() -> None:
    """Data: y = a w, noise 2, so that the weight of the data is w'w / 4; a prior as sure as they draws half the way."""
    wave = Line(("x",)).residual(model(values={"friction.coulomb": 0.0, "friction.viscous": 0.0}))["x"]
    alone = fit(model(values={"friction.coulomb": 10.0, "friction.viscous": 0.0}), [Line(("x",))], [COULOMB])
    power = float(np.sum((np.sin(1e-3 * np.arange(wave.size) * 3.0)) ** 2)) / 4.0
    rig = knowing(friction__coulomb=ParameterPrior("N", start=5.0, sigma=power**-0.5))
    held = []
    for start in (5.0, 20.0):
        (free,) = with_prior_knowledge([replace(COULOMB, start=start)], rig)
        began = model(values={"friction.coulomb": start, "friction.viscous": 0.0})
        held.append(fit(began, [Line(("x",))], [free])["friction.coulomb"].value)
    assert held[0] == pytest.approx(held[1], rel=1e-6)
    assert held[0] == pytest.approx(0.5 * (5.0 + alone["friction.coulomb"].value), rel=1e-4)


def test_a_rig_value_with_a_prior_is_free() -> None:
    axis = make_experiment("axis", time_grid(0.5), {"u": 1.0, **BALANCED})
    sure = {f.name for f in base_parameters(model(), [axis])}
    doubted = knowing(rig__piston_area_1=ParameterPrior("m^2", start=8e-4, sigma=1e-5))
    assert {f.name for f in base_parameters(model(rig=doubted), [axis])} - sure == {"rig.piston_area_1"}


def test_a_supply_pressure_with_a_prior_is_free_where_it_was_not_recorded() -> None:
    rig = knowing(rig__supply_pressure=ParameterPrior("Pa", start=6e5))
    bare, told = ({"u": 1.0, **BALANCED}, {"u": 1.0, **BALANCED, "p_supply": 7e5})
    for signals, free in ((bare, True), (told, False)):
        names = {
            f.name for f in base_parameters(model(rig=rig), [make_experiment("axis", time_grid(0.5), signals, rig=rig)])
        }
        assert ("rig.supply_pressure" in names) is free


def test_a_dead_volume_that_is_not_stated_is_free() -> None:
    axis = make_experiment("axis", time_grid(0.5), {"u": 1.0, **BALANCED}, rig=replace(RIG, dead_volume_1=None))
    bare = model(values={"rig.dead_volume_1": 2e-5}, rig=replace(RIG, dead_volume_1=None))
    assert "rig.dead_volume_1" in {f.name for f in base_parameters(bare, [axis])}


def test_an_effect_starts_where_the_file_says() -> None:
    leak, here = catalogue()["piston-leak"], rig_quantities(model())
    known = {"piston-leak.area": ParameterPrior("m^2", start=3e-8, upper=4e-8)}
    assert initial_guesses(leak, here, known) == [{"piston-leak.area": 3e-8}]
    (free,) = effect_parameters(leak, model(rig=replace(RIG, priors=known)), here)
    assert free.upper == 4e-8
