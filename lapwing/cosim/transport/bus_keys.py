"""Keys of the lock step on the bus: the part between the key prefix of a run and the name of a participant.

The key prefix is the first part of every Zenoh key of a run, and separates runs on one network.
"""

import re

STEP_KEY = "_step"  # step packets
BATCH_KEY = "_batch"  # log packets
WAITING_KEY = "_waiting"  # text: the data that a participant has waited for
OUTSIDE_KEY = "_outside"  # program outside the run that a service waits for, with its own time-out
REPORTS_KEY = "_reports"  # entries of the log's metadata, as a JSON object
ALIVE_KEY = "_alive"  # token: the participant is present
CONFIG_KEY = "_config"  # run configuration of a participant, as reply to a query
DIVERGED_KEY = "_diverged"  # reason why a state is invalid
ENDED_KEY = "_ended"  # from the clock owner: "" if the run was completed, the reason if it ended early
REFUSED_KEY = "_refused"  # number of messages that a participant has rejected
DEADLINES_KEY = "_deadlines"  # lateness of a participant in a paced run
BLOCK_TIME_KEY = "_block_time"  # [s] of processor time in the blocks of a service
COMPILING_KEY = "_compiling"  # a participant compiles kernels
RECORDED_KEY = "_log_progress"  # progress of the log; empty if it is complete
HEARD_KEY = "_heard"  # token: the participant has received the last message of each of its producers
LOGGED_KEY = "_logged"  # token: the participant has received the last message of the recorder

ENCODER = "_messages"  # suffix of the name of the process that encodes an external service's messages


def check_key_prefix(key_prefix: str) -> None:
    """Raise ValueError if the text cannot be the first part of a Zenoh key."""
    if not re.fullmatch(r"[\w.-]+(/[\w.-]+)*", key_prefix, re.ASCII):
        raise ValueError(f"--key-prefix {key_prefix}: expected letters, digits, _, - and . (parts joined by /)")
