"""The report of the source thesis (``pneucli report --thesis``): its figures with this rig's data, in its numbers.

One file a chapter, as in :mod:`pneucli.report.sections`.
"""

from pneucli.report.page_elements import declared_sections

SECTIONS = declared_sections(__name__)
