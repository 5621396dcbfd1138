"""Keys of the lock step on the bus: what follows the key prefix of a run, before the name of a participant."""

STEP_KEY = "_step"  # bundles
BATCH_KEY = "_batch"  # what the recorder is given
WAITING_KEY = "_waiting"  # what somebody has long waited for
ALIVE_KEY = "_alive"  # who is there
SETUP_KEY = "_setup"  # what somebody flies, to those who ask
DIVERGED_KEY = "_diverged"  # why a state is no longer sound
ENDED_KEY = "_ended"  # of the owner of time: that the run has come to its end, or why it ended before
REFUSED_KEY = "_refused"  # how many messages of strangers somebody has refused
DEADLINES_KEY = "_deadlines"  # of a run that keeps a speed: how late somebody was
COMPILING_KEY = "_compiling"  # somebody compiles kernels
RECORDED_KEY = "_log_progress"  # how far the log is; an empty message: it is complete
HEARD_KEY = "_heard"  # a token: somebody has received the last message of every service that it takes messages from
LOGGED_KEY = "_logged"  # a token: somebody has received the last message of the recorder

ENCODER = "_messages"  # ending of the name of a process that makes the messages of a program of somebody else's
