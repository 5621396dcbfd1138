"""Report of a flight: a page with interactive plots, or the same plots on paper.

Each file of `lapwing.studies.report.plots` is a plot. It returns a description of the plot (see `plot`), which
`plotly_figure` draws in a browser and `matplotlib_figure` on paper.
"""

from lapwing.studies.report.write import check_format, write

__all__ = ["check_format", "write"]
