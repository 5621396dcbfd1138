"""Stability study: hard cases with bounds, each with a baseline method that fails it.

`lapwing stability [CASE]`; a case is a file of `cases/`.
"""

from lapwing.studies.stability.case_result import CaseResult, Curve, Plot, Row, Sweep

__all__ = ["CaseResult", "Curve", "Plot", "Row", "Sweep"]
