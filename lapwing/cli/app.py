"""The Typer application, and the groups in which its help lists the commands."""

from typing import Any

import typer
from typer.core import TyperGroup

from lapwing.cli.error_exit import user_errors

GROUPS = {  # headings and commands in the order of a workflow
    "Fly": ("scenes", "check", "run", "service", "autopilot"),
    "Inspect": ("studio", "report", "view", "render", "parameters"),
    "Study": ("performance", "effects", "accuracy", "stability", "tune", "campaign", "compare", "validate", "identify"),
    "Logs": ("import", "info", "verify", "recover", "export", "replay", "resimulate"),
    "Couple": ("export-fmu", "export-ssp", "export-library"),
    "Set up": ("new", "precompile", "certificates", "protocol", "schema"),
}


class GroupedCommands(TyperGroup):
    """Group that lists its commands under the headings of `GROUPS`, others last, and reports their errors."""

    def invoke(self, ctx: Any) -> Any:
        """Run a command; print errors as one line."""
        with user_errors():
            return super().invoke(ctx)

    def format_commands(self, ctx: Any, formatter: Any) -> None:
        """Write each command with the whole first line of its help."""
        grouped = {name for names in GROUPS.values() for name in names}
        others = tuple(name for name in self.list_commands(ctx) if name not in grouped)
        for heading, names in {**GROUPS, "Other": others}.items():
            commands = {name: self.get_command(ctx, name) for name in names}
            rows = [(n, (c.help or "").partition("\n")[0]) for n, c in commands.items() if c and not c.hidden]
            if rows:
                with formatter.section(heading):
                    formatter.write_dl(rows)


app = typer.Typer(add_completion=False, cls=GroupedCommands, pretty_exceptions_enable=False, rich_markup_mode=None)
