"""The Typer application, and the groups in which its help lists the commands."""

from typing import Any

import typer
from typer.core import TyperGroup

from lapwing.cli.error_exit import user_errors

FIRST = {  # commands of nine in ten tasks, each with an example
    "run": "lapwing run delivery_mission --view",
    "view": "lapwing view recordings/LOG.mcap",
    "new": "lapwing new vehicle my_quad --set mass=750g --set cells=4S",
    "check": "lapwing check my_flight.toml --set run.seed=2",
    "studio": "lapwing studio",
    "tune": "lapwing tune my_flight.toml --out my_gains.toml",
    "campaign": "lapwing campaign hover --vary 'vehicle.mass=normal(10.4,0.1)'",
    "validate": "lapwing validate crazyflie_21 FLIGHTS",
}
GROUPS = {  # headings and commands in the order of a workflow
    "Start here": tuple(FIRST),
    "Fly": ("scenes", "test", "service"),
    "Inspect": ("report", "render", "parameters"),
    "Study": ("performance", "effects", "accuracy", "stability", "compare", "identify", "feed"),
    "Logs": ("import", "info", "verify", "recover", "export", "replay", "resimulate"),
    "Couple": ("export-fmu", "export-ssp", "export-library"),
    "Set up": ("precompile", "certificates", "protocol", "schema"),
}


class GroupedCommands(TyperGroup):
    """Group that lists its commands under the headings of `GROUPS`, others last, and reports their errors."""

    def invoke(self, ctx: Any) -> Any:
        """Run a command; print errors as one line."""
        with user_errors():
            return super().invoke(ctx)

    def format_commands(self, ctx: Any, formatter: Any) -> None:
        """Write each command with the whole first line of its help, and an example below the first ones."""
        grouped = {name for names in GROUPS.values() for name in names}
        others = tuple(name for name in self.list_commands(ctx) if name not in grouped)
        for heading, names in {**GROUPS, "Other": others}.items():
            commands = {name: self.get_command(ctx, name) for name in names}
            shown = [(n, (c.help or "").partition("\n")[0]) for n, c in commands.items() if c and not c.hidden]
            rows = [row for n, text in shown for row in ((n, text), ("", FIRST.get(n, ""))) if any(row[1:])]
            if rows:
                with formatter.section(heading):
                    formatter.write_dl(rows)


app = typer.Typer(add_completion=False, cls=GroupedCommands, pretty_exceptions_enable=False, rich_markup_mode=None)
