"""Views of a flight or of a study: report, 3D view, live page, studio, diagrams."""
