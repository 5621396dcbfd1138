"""Lie groups and homogeneous spaces: exponential, logarithm, their derivatives, retraction, transport."""
