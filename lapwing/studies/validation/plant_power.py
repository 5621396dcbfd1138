"""Electrical power of many vehicles side by side."""

# mypy: disable-error-code="no-untyped-def"

from lapwing.dynamics.effects._rotor_sums import total
from lapwing.dynamics.simd_batch import WIDTH, take
from lapwing.dynamics.vehicles.multirotor_equations import MultirotorDrive, evaluate, motion_of
from lapwing.kernels import kernel


@kernel
def electrical_power(like, memory, columns, out, first, last):
    """Write the power [W] that the motors of each member take under its last voltages.

    Args:
        like: a Member of `lapwing.dynamics.simd_batch`.
        memory: of its blocks, flat.
        columns: of a block.
        out: shape (members,); written.
        first: block.
        last: block after the last.
    """
    for m in range(first * WIDTH, last * WIDTH):
        x = take(like, memory, (m // WIDTH) * columns * WIDTH + m % WIDTH)
        drive = MultirotorDrive(x.parameters, x.body, x.memory, x.voltage)
        _, rotors, _, _ = evaluate(drive, x.start, motion_of(x.parameters.layout, x.motion))
        out[m] = total(rotors.power)
