"""The chapters of the page: one file a chapter with ``section(material)`` and its ``PLACE``.

A chapter without its artifact is left out. Files without a place help others.
"""

from pneucli.report.page_elements import declared_sections

SECTIONS = declared_sections(__name__)
