"""The report of the source thesis (``pneucli report --thesis``): its figures with this rig's data, in its numbers."""

from __future__ import annotations

from pneucli.report.page_elements import SectionMaker
from pneucli.report.thesis.control import section as control
from pneucli.report.thesis.tensor_product import section as tensor_product
from pneucli.report.thesis.valve import section as figures

SECTIONS: tuple[SectionMaker, ...] = (figures, control, tensor_product)
