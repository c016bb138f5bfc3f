"""The ensemble, a part of ``design``: gains of ``best`` that hold on rigs like this one, and each law on fresh rigs."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from pneucli.closed_loop.ensemble import (
    CONFIDENCE,
    FIGURES,
    LAW_RIGS,
    LAW_SEARCH_RIGS,
    PROOF_RIGS,
    Choice,
    Proof,
    RigEnsemble,
    RigTest,
    chosen_data,
    chosen_requirements,
    ensemble_of,
    family_of,
    prove,
    rig_test,
    search,
)
from pneucli.closed_loop.robustness import sigma_from_intervals
from pneucli.closed_loop.simulation import ClosedLoopSetup
from pneucli.controller.laws import DEFAULT
from pneucli.controller.parameters import Controller
from pneucli.design.cascade_design import design_cascade
from pneucli.design.control_laws import DesignData, controller_for
from pneucli.design.requirements import Requirements
from pneucli.messages.progress import counted
from pneucli.physics.effects import catalogue
from pneucli.pipeline.context import Context
from pneucli.simulate.model import Model
from pneucli.stages.acceptance import parameter_intervals


@dataclass(frozen=True)
class EnsembleDesign:
    """``best`` with gains from the ensemble, the model and the requirements that give them, and the test of a rig."""

    controller: Controller
    model: Model
    requirements: Requirements
    choice: Choice
    ensemble: RigEnsemble
    test: RigTest


def design_on_ensemble(
    context: Context, model: Model, wanted: Requirements, setup: ClosedLoopSetup, sealed: float | None
) -> EnsembleDesign:
    """Return the design whose gains hold best on the ensemble of rigs that the recordings allow."""

    def make(choice: Choice) -> Controller:
        return design_cascade(*chosen_requirements(choice, model, wanted), sealed)

    def progress(share: float) -> None:
        context.progress(f"gains on the ensemble, {share:.0%}")

    ensemble = ensemble_of(model, sigma_from_intervals(parameter_intervals(context), model))
    test = rig_test(design_cascade(model, wanted, sealed), wanted)
    choice = search(ensemble, make, setup, test, family_of(ensemble), progress)
    return EnsembleDesign(make(choice), *chosen_requirements(choice, model, wanted), choice, ensemble, test)


def ensemble_answer(
    context: Context, found: EnsembleDesign, laws: Mapping[str, Controller], data: DesignData, setup: ClosedLoopSetup
) -> dict[str, Any]:
    """Return what the chosen gains promise, and what every law does on fresh rigs, as it is stated and as chosen."""
    promise = prove(found.controller, found.ensemble, found.test, setup, PROOF_RIGS)
    rows = {DEFAULT: _row(promise), f"{DEFAULT}, by the rules": _law_row(found, data.cascade, setup)}
    others = [name for name in laws if name != DEFAULT]
    for i, name in enumerate(others):
        context.progress(counted("laws on the ensemble", i, len(others)))
        rows[name] = _law_row(found, laws[name], setup)
        rows[f"{name}, ensemble"] = _law_row(found, _law_on_ensemble(name, found, data, setup), setup)
    limiting = promise.limiting
    return {
        "effects": list(found.ensemble.effects),
        "spool_lag": {"value": found.choice.lag, "unit": "s"},
        "confidence": CONFIDENCE,
        "limits": {
            name: {"value": limit, "unit": unit}
            for (name, unit), limit in zip(FIGURES.items(), found.test.limits, strict=True)
        },
        "laws": rows,
        "limiting": limiting or None,
        "rescued": dict(promise.rescued),
        "separate": catalogue()[limiting].separate if limiting else None,
    }


def _law_on_ensemble(name: str, found: EnsembleDesign, data: DesignData, setup: ClosedLoopSetup) -> Controller:
    """Return a law with the corners that hold best on the ensemble."""
    family = [choice for choice in family_of(found.ensemble) if choice.lag == 0.0]

    def make(choice: Choice) -> Controller:
        return controller_for(name, chosen_data(choice, data))

    return make(search(found.ensemble, make, setup, found.test, family, count=LAW_SEARCH_RIGS))


def _law_row(found: EnsembleDesign, controller: Controller, setup: ClosedLoopSetup) -> dict[str, Any]:
    return _row(prove(controller, found.ensemble, found.test, setup, LAW_RIGS, explained=False))


def _row(proof: Proof) -> dict[str, Any]:
    """Return one controller's rigs, those that it holds, and its figures over their limits, worst and median."""
    worst, median = proof.ratios.max(axis=0), np.median(proof.ratios, axis=0)
    return {
        "rigs": len(proof.ratios),
        "held": proof.held,
        "probability": proof.probability,
        "worst": {n: float(v) if math.isfinite(v) else None for n, v in zip(FIGURES, worst, strict=True)},
        "median": {n: float(v) for n, v in zip(FIGURES, median, strict=True)},
    }
