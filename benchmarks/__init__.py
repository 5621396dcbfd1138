"""Measurements of Lapwing and of other simulators: `python -m benchmarks.NAME --help` shows what each one measures."""
