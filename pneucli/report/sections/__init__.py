"""The chapters of the page, in the order in which they stand there; each is absent where its artifact is."""

from __future__ import annotations

from pneucli.report.parts import SectionMaker
from pneucli.report.sections.bench import section as bench
from pneucli.report.sections.checks import section as checks
from pneucli.report.sections.closed_loop import section as closed_loop
from pneucli.report.sections.comparison import section as comparison
from pneucli.report.sections.diagnosis import section as diagnosis
from pneucli.report.sections.friction import section as friction
from pneucli.report.sections.logs import section as logs
from pneucli.report.sections.measured import section as measured
from pneucli.report.sections.open_loop import section as open_loop
from pneucli.report.sections.parameters import section as parameters
from pneucli.report.sections.relations import section as relations
from pneucli.report.sections.robustness import section as robustness
from pneucli.report.sections.tensor import section as tensor
from pneucli.report.sections.thesis import section as thesis
from pneucli.report.sections.valve import section as valve
from pneucli.report.sections.where import section as where

SECTIONS: tuple[SectionMaker, ...] = (
    where,
    diagnosis,
    comparison,
    parameters,
    relations,
    valve,
    friction,
    closed_loop,
    logs,
    bench,
    robustness,
    open_loop,
    tensor,
    thesis,
    measured,
    checks,
)
