"""The plant service: clock owner and vehicle dynamics."""

# Of parts of a step: the shortest substep, 1e-14 s, still advances a time of 10 s; sums are not compensated.
LEAST_PART_TOLERANCE = 1e-12
