"""Report of a flight: a page with interactive plots, or the same plots on paper.

Each file of `lapwing.views.report.plots` is a plot. It returns a description of the plot (see `plot`), which
`plotly_figure` draws in a browser and `matplotlib_figure` on paper.
"""

from lapwing.views.report.write import write

__all__ = ["write"]
