"""When this process read its first source that uses kernels; imported before numba, which takes its time."""

import time

BEGAN = time.time()  # [s]
