"""Information of the start state and of the commands about attitude and rate after 0.5 s.

    python -m benchmarks.validation_information MAPPING FLIGHTS...

Fits regressions without physics to all flights except one, predicts that one, and prints the mean absolute rate error
and the mean angle of the attitude error by the inputs of the regression: the start state, commands before the window,
and commands up to some time in the window.
"""

from pathlib import Path

import numpy as np

from benchmarks._command import command_line
from lapwing.studies.flight_import.open_flight import open_flight
from lapwing.studies.validation.linear_baseline import RIDGE, SLICE, _regressors, _targets
from lapwing.studies.validation.windows import window_starts

LONGEST, STATES, PAST = 50, 9, 2  # samples of a window; columns of the state; slices of commands before it
STRIDE = 10  # samples between the starts of two windows


def main(mapping: str, flights: list[Path]) -> None:
    recordings = [open_flight(path, mapping) for path in flights]
    starts = [window_starts(recording, LONGEST, STRIDE) for recording in recordings]
    used = [(f, s) for f, s in zip(recordings, starts, strict=True) if len(s)]
    regressors = [_regressors(f, s, LONGEST) for f, s in used]
    desired = [_targets(f, s, (LONGEST,))[:, 6:] for f, s in used]
    rotors = used[0][0].rotors
    columns = {"start state": 0, "commands before the window, too": PAST}
    columns |= {f"commands of the first {k * SLICE} samples, too": PAST + k for k in (5, 7, LONGEST // SLICE)}
    for name, slices in columns.items():
        chosen = np.r_[: STATES + rotors * slices, -1]
        errors = []
        for k in range(len(used)):
            x = np.concatenate([r[:, chosen] for j, r in enumerate(regressors) if j != k])
            y = np.concatenate([t for j, t in enumerate(desired) if j != k])
            scale = np.maximum(x.std(axis=0), 1e-6)
            x, scale[-1] = x / np.r_[scale[:-1], 1.0], 1.0
            gain = np.linalg.solve(x.T @ x + RIDGE * len(x) * np.eye(x.shape[1]), x.T @ y)
            errors.append(desired[k] - regressors[k][:, chosen] / scale @ gain)
        error = np.concatenate(errors)
        angle = np.linalg.norm(error[:, :3], axis=1).mean()
        print(f"{name}: rate {np.abs(error[:, 3:]).mean():.4f} rad/s, attitude {angle:.4f} rad", flush=True)


if __name__ == "__main__":
    command_line(main)
