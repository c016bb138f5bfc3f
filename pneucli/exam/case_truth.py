"""The sealed truth of a case: what is hidden, and what the rig is like."""

from __future__ import annotations

from collections.abc import Sequence

from pneucli.exam.conditions import USUAL, Conditions
from pneucli.exam.hidden_effect import HiddenEffect
from pneucli.exam.hidden_sides import ALL_BY_NAME
from pneucli.exam.laboratory import Laboratory
from pneucli.exam.rig.gas import wall_conductance
from pneucli.exam.rig.parameters import ONE_CHAMBER, Parameters


def _baseline_parameters(laboratory: Laboratory) -> dict[str, dict[str, float]]:
    """Return the true parameters of the effects in the pipeline file, as far as there is one true value.

    The walls of a cylinder's chamber grow with the stroke: only a vessel has one conductance.
    """
    par, found = laboratory.parameters, {}
    for name in laboratory.effects:
        if name != "heat-transfer" or par.wall_coefficient <= 0.0:
            found[name] = ALL_BY_NAME[name].true_parameters(par)
        elif not laboratory.has_cylinder and laboratory.vessel_volume is not None:
            found[name] = {"conductance": float(wall_conductance(par, 0.0, laboratory.vessel_volume))}
    return found


def _second_valve(par: Parameters) -> dict[str, float]:
    return {
        "effective_area_2_at_10V": par.effective_area_2,
        "overlap_2_V": par.overlap_2,
        "area_exponent_2": par.exponent_2,
    }


def case_truth(
    laboratory: Laboratory, hidden: Sequence[HiddenEffect], outside: str, conditions: Conditions
) -> dict[str, object]:
    """Return the truth of a case with these hidden effects and this disturbance outside the catalogue."""
    par = laboratory.parameters
    return {
        "hidden": {effect.name: effect.true_parameters(par) for effect in hidden},
        "outside_the_catalogue": outside or None,
        "baseline": list(laboratory.effects),
        "baseline_parameters": _baseline_parameters(laboratory),
        "command_sets_area": conditions.source is None,
        "part": ALL_BY_NAME[outside].part if outside else None,
        "over": ALL_BY_NAME[outside].variable if outside else None,
        "conditions": list(conditions.names) or [USUAL],
        "verdict": "unexplained" if outside else "missing-effect" if hidden else "adequate",
        "unexplained_is_right": bool(outside) or conditions.allows_unexplained,
        "base": {
            "coulomb": par.coulomb,
            "viscous": par.viscous,
            "effective_area_at_10V": par.effective_area,
            "overlap_V": par.overlap,
            "area_exponent": par.exponent,
            "null_V": par.command_null,
            "fully_open_V": par.command_range,
            "critical_ratio": par.critical_ratio,
            **({} if par.arrangement == ONE_CHAMBER else _second_valve(par)),
        },
        "sensor_noise_pressure_Pa": laboratory.sensors.pressure,
    }
