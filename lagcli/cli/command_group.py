"""The commands as a group that answers an unknown one with what was probably meant."""

from __future__ import annotations

import os
from typing import Any  # the classes of a context and of a command are other ones by the version of typer

from typer.core import TyperGroup

from lagcli.errors import diagnostics

# Words for commands in other programs, and what to type here.
_MEANT = {
    **dict.fromkeys(("run", "sim", "solve", "integrate", "start", "exec"), "lagcli simulate MODEL"),
    **dict.fromkeys(("plot", "draw", "figure", "show"), "lagcli simulate MODEL --plot FILE"),
    **dict.fromkeys(("count", "freedoms", "mobility"), "lagcli dof MODEL"),
    **dict.fromkeys(("validate", "lint", "classify", "verify", "analyze", "analyse"), "lagcli check MODEL"),
    **dict.fromkeys(("equations", "eom", "latex", "lagrange"), "lagcli derive MODEL"),
    **dict.fromkeys(("help",), "lagcli --help"),
    **dict.fromkeys(("version",), "lagcli --version"),
    **dict.fromkeys(("error", "why", "what", "codes"), "lagcli explain CODE"),
}


class CommandGroup(TyperGroup):
    """The group of all commands."""

    def resolve_command(self, ctx: Any, args: list[str]) -> Any:
        """The command that the first argument names; ends with exit 2 and a hint where there is none."""
        name = args[0]
        if self.get_command(ctx, name) is None and not name.startswith("-"):
            shown = diagnostics.printable(name).replace("\n", " ")[:200]
            ctx.fail(f"there is no command `{shown}`; {self._hint(ctx, name, shown)}")
        return super().resolve_command(ctx, args)

    def _hint(self, ctx: Any, name: str, shown: str) -> str:
        if name.lower().endswith((".yaml", ".yml")) or os.path.exists(name):
            return f"did you mean `lagcli simulate {shown}`?"
        if name.casefold() in _MEANT:
            return f"did you mean `{_MEANT[name.casefold()]}`?"
        commands = self.list_commands(ctx)
        return diagnostics.nearest(name, commands) or f"the commands are {diagnostics.listed(commands)}"
