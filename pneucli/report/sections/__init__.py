"""The chapters of the page, in their order; a chapter without its artifact is left out."""

from __future__ import annotations

from pneucli.report.page_elements import SectionMaker
from pneucli.report.sections.checks import section as checks
from pneucli.report.sections.closed_loop import section as closed_loop
from pneucli.report.sections.comparison import section as comparison
from pneucli.report.sections.correlations import section as correlations
from pneucli.report.sections.diagnosis import section as diagnosis
from pneucli.report.sections.error_location import section as error_location
from pneucli.report.sections.flow import section as flow
from pneucli.report.sections.friction import section as friction
from pneucli.report.sections.law_comparison import section as law_comparison
from pneucli.report.sections.log_replay import section as log_replay
from pneucli.report.sections.open_loop import section as open_loop
from pneucli.report.sections.parameters import section as parameters
from pneucli.report.sections.recordings import section as recordings
from pneucli.report.sections.robustness import section as robustness
from pneucli.report.sections.valve import section as valve

SECTIONS: tuple[SectionMaker, ...] = (
    error_location,
    diagnosis,
    comparison,
    flow,
    parameters,
    correlations,
    valve,
    friction,
    closed_loop,
    log_replay,
    law_comparison,
    robustness,
    open_loop,
    recordings,
    checks,
)
