"""The report of a flight: a page whose plots are drawn in the reader's browser, or the same plots on paper.

Each plot is a file of `lapwing.studies.report.plots`; adding one is adding a file. It says what is to be seen (`plot`);
`browser` and `paper` draw it.
"""

from lapwing.studies.report.write import check_format, write

__all__ = ["check_format", "write"]
