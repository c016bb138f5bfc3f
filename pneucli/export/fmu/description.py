"""``modelDescription.xml`` and ``buildDescription.xml`` of the FMU, by FMPy."""

from __future__ import annotations

import hashlib
from collections.abc import Sequence
from typing import TYPE_CHECKING
from xml.sax.saxutils import quoteattr

from pneucli.errors import InputError
from pneucli.export.fmu.variables import Variable
from pneucli.units import parse_unit
from pneucli.version import __version__

if TYPE_CHECKING:
    from fmpy.model_description import ModelDescription, ModelVariable, Unit

MODEL_IDENTIFIER = "pneucli_plant"
SOURCE_FILE = "pneucli_plant.c"


def require_fmpy() -> None:
    """Raise InputError where FMPy is not installed."""
    try:
        import fmpy  # noqa: F401, PLC0415 - an extra
    except ImportError as error:
        mend = "pip install 'pneucli[fmu]'"
        raise InputError("--to fmu", "FMPy is not installed", "the extra fmu", mend, code="E009") from error


def token_of(sources: Sequence[str]) -> str:
    """Return the instantiation token: it changes with any of the sources."""
    return "{" + hashlib.sha256("\n".join(sources).encode()).hexdigest()[:32] + "}"


def model_description(
    name: str, title: str, token: str, variables: Sequence[Variable], step: float
) -> ModelDescription:
    """Return the description of the FMU.

    Args:
        name: Name of the model.
        title: What it is.
        token: Instantiation token.
        variables: Its variables.
        step: Communication step in s that an importer takes by default; of model exchange, time between events.
    """
    from fmpy.model_description import (  # noqa: PLC0415 - an extra
        CoSimulation,
        DefaultExperiment,
        ModelDescription,
        ModelExchange,
        Unknown,
    )

    written = [_time(), *(_variable(one) for one in variables)]
    outputs = [one for one in written if one.causality == "output"]
    return ModelDescription(
        fmiVersion="3.0",
        modelName=name,
        instantiationToken=token,
        description=title,
        generationTool=f"pneucli {__version__}",
        variableNamingConvention="flat",
        defaultExperiment=DefaultExperiment(startTime="0", stopTime="10", stepSize=repr(step)),
        modelExchange=ModelExchange(
            modelIdentifier=MODEL_IDENTIFIER, canGetAndSetFMUstate=True, canSerializeFMUstate=True
        ),
        coSimulation=CoSimulation(
            modelIdentifier=MODEL_IDENTIFIER,
            canHandleVariableCommunicationStepSize=True,
            canGetAndSetFMUstate=True,
            canSerializeFMUstate=True,
        ),
        unitDefinitions=[_unit(unit) for unit in dict.fromkeys(one.unit for one in variables)],
        modelVariables=written,
        outputs=[Unknown(variable=one) for one in outputs],
        initialUnknowns=[Unknown(variable=one) for one in outputs],
    )


def build_description() -> str:
    """Return ``buildDescription.xml``: how another platform compiles the sources."""
    return "\n".join(
        [
            '<?xml version="1.0" encoding="UTF-8"?>',
            '<fmiBuildDescription fmiVersion="3.0">',
            f"  <BuildConfiguration modelIdentifier={quoteattr(MODEL_IDENTIFIER)}>",
            '    <SourceFileSet language="C99">',
            f"      <SourceFile name={quoteattr(SOURCE_FILE)}/>",
            "    </SourceFileSet>",
            '    <Library name="m" external="true" description="the mathematical functions, where they are apart"/>',
            "  </BuildConfiguration>",
            "</fmiBuildDescription>",
            "",
        ]
    )


def _time() -> ModelVariable:
    from fmpy.model_description import ModelVariable  # noqa: PLC0415 - an extra

    about = {"causality": "independent", "variability": "continuous", "description": "time", "unit": "s"}
    return ModelVariable(name="time", valueReference=0, type="Float64", **about)


def _variable(one: Variable) -> ModelVariable:
    from fmpy.model_description import ModelVariable  # noqa: PLC0415 - an extra

    variability = "fixed" if one.kind == "parameter" else "continuous"
    initial = {"input": None, "output": None, "parameter": None}[one.kind]
    return ModelVariable(
        name=one.name,
        valueReference=one.reference,
        type="Float64",
        causality=one.kind,
        variability=variability,
        initial=initial,
        unit=one.unit,
        description=one.description,
        start=None if one.start is None else repr(one.start),
    )


def _unit(text: str) -> Unit:
    """Return a unit with its exponents of SI base units."""
    from fmpy.model_description import BaseUnit, Unit  # noqa: PLC0415 - an extra

    unit = parse_unit(text)
    m, kg, s, K, A = unit.dimension
    return Unit(name=text, baseUnit=BaseUnit(m=m, kg=kg, s=s, K=K, A=A, factor=unit.factor, offset=unit.offset))
