"""Time at which this process read its first source with kernels; imported before numba, which loads slowly."""

import time

BEGAN = time.time()  # [s]
