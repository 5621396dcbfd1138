"""Time at which this process read its first source with kernels; imported before numba, which takes long."""

import time

BEGAN = time.time()  # [s]
