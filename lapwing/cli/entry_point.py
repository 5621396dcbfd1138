"""Entry point of the command `lapwing`: handles Ctrl-C before the other modules are imported."""

FILES = (("stdin", "r"), ("stdout", "w"), ("stderr", "w"))  # file descriptors


def main() -> None:
    """Run the command `lapwing`."""
    try:
        from lapwing.cosim.processes.interrupt import (
            Interrupted,
            interrupts_first,
            raise_on_interrupt,
            report_interrupt,
        )

        try:
            raise_on_interrupt()
            with interrupts_first():
                prepare_streams()
                from lapwing.cli.main import main as carry_out

                carry_out()
        except Interrupted as interrupted:
            raise SystemExit(report_interrupt(interrupted)) from None
    except KeyboardInterrupt:  # Python raises it for SIGINT before `raise_on_interrupt`
        from lapwing.cosim.processes.interrupt import SIGINT, Interrupted, report_interrupt

        raise SystemExit(report_interrupt(Interrupted(SIGINT))) from None


def prepare_streams() -> None:
    """Open the null device for closed streams, and escape characters that the encoding of an output lacks."""
    import io
    import os
    import sys

    for number, (name, mode) in enumerate(FILES):
        if getattr(sys, name) is None:
            null = os.open(os.devnull, os.O_RDWR)
            if null != number:
                os.dup2(null, number)
                os.close(null)
            setattr(sys, name, open(number, mode, encoding="utf-8", closefd=False))  # noqa: SIM115
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, io.TextIOWrapper) and stream.errors == "strict":
            stream.reconfigure(errors="backslashreplace")
