"""Keys of the lock step on the bus: what follows the key prefix of a run, before the name of a participant."""

STEP_KEY = "_step"  # bundles
BATCH_KEY = "_batch"  # what the recorder is given
WAITING_KEY = "_waiting"  # what somebody has long waited for
ALIVE_KEY = "_alive"  # who is there
SETUP_KEY = "_setup"  # what somebody flies, to those who ask
DIVERGED_KEY = "_diverged"  # why a state is no longer sound
COMPILING_KEY = "_compiling"  # somebody compiles kernels
