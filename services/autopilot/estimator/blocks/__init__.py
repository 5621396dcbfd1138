"""Estimator blocks, one per sensor in the order of fusion, which share the filter's state; or the ground truth."""
