"""The report of a flight: one HTML page with plots, beside its log.

Each plot is a file of `studies.report.plots`; adding one is adding a file.
"""

from studies.report.page import write

__all__ = ["write"]
