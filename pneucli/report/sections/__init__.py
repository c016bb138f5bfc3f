"""The chapters of the page, in the order in which they stand there; each is absent where its artifact is."""

from __future__ import annotations

from pneucli.report.page_elements import SectionMaker
from pneucli.report.sections.checks import section as checks
from pneucli.report.sections.closed_loop import section as closed_loop
from pneucli.report.sections.comparison import section as comparison
from pneucli.report.sections.correlations import section as relations
from pneucli.report.sections.diagnosis import section as diagnosis
from pneucli.report.sections.error_location import section as where
from pneucli.report.sections.friction import section as friction
from pneucli.report.sections.law_comparison import section as bench
from pneucli.report.sections.log_replay import section as logs
from pneucli.report.sections.open_loop import section as open_loop
from pneucli.report.sections.parameters import section as parameters
from pneucli.report.sections.recordings import section as measured
from pneucli.report.sections.robustness import section as robustness
from pneucli.report.sections.tensor_product import section as tensor
from pneucli.report.sections.thesis_figures import section as thesis
from pneucli.report.sections.valve import section as valve

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
