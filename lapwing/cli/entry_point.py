"""Entry point of the command `lapwing`: handles Ctrl-C before the other modules are imported."""


def main() -> None:
    """Run the command `lapwing`."""
    try:
        from lapwing.cosim.processes.interrupt import Interrupted, end_at_once, say_end

        try:
            end_at_once()
            from lapwing.cli.std_streams import prepare_streams

            prepare_streams()
            from lapwing.cli.main import main as carry_out

            carry_out()
        except Interrupted as interrupted:
            raise SystemExit(say_end(interrupted)) from None
    except KeyboardInterrupt:  # what Python makes of SIGINT up to `end_at_once`
        from lapwing.cosim.processes.interrupt import SIGINT, Interrupted, say_end

        raise SystemExit(say_end(Interrupted(SIGINT))) from None
