"""Electrical power of a batch of vehicles."""

# mypy: disable-error-code="no-untyped-def"

from lapwing.dynamics.effects._rotor_sums import total
from lapwing.dynamics.simd_batch import WIDTH, take
from lapwing.dynamics.vehicles.multirotor_equations import MultirotorDrive, evaluate, motion_of
from lapwing.kernels import kernel


@kernel
def electrical_power(like, memory, columns, out, first, last):
    """Write the power [W] of the motors of each member at its last voltages.

    Args:
        like: prototype, a Member of `lapwing.dynamics.simd_batch`.
        memory: blocks of the batch, flat.
        columns: number of columns of a block.
        out: result, shape (members,).
        first: first block.
        last: block after the last.
    """
    for m in range(first * WIDTH, last * WIDTH):
        x = take(like, memory, (m // WIDTH) * columns * WIDTH + m % WIDTH)
        drive = MultirotorDrive(x.parameters, x.body, x.memory, x.voltage)
        _, rotors, _, _ = evaluate(drive, x.start, motion_of(x.parameters.layout, x.motion))
        out[m] = total(rotors.power)
