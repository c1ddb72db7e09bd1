"""`lagcli schema`: the JSON Schema of model files."""

from __future__ import annotations

import json
from typing import Annotated

from lagcli.cli.commands import options
from lagcli.cli.terminal import exits


@options.command()
def schema(
    output: Annotated[
        str | None, options.output("write it to this file, lagcli.schema.json as a rule")
    ] = None,
    force: options.ForceOption = False,
    quiet: options.QuietOption = False,
) -> None:
    """Print the JSON Schema of model files (draft 7), by which editors complete, explain and check keys.

    New models name lagcli.schema.json, in their own folder, on their first line.
    """
    from lagcli.cli.commands import new_command
    from lagcli.input import format_schema

    name = output or new_command.STDOUT
    new_command.write(name, format_schema.text(), force=force, may_replace=_is_schema)
    if name != new_command.STDOUT and not quiet:
        exits.print_err(f"wrote {name}")


def _is_schema(old: str) -> bool:
    """True for a schema of the model format, of whatever version."""
    try:
        found = json.loads(old)
    except ValueError:
        return False
    return isinstance(found, dict) and str(found.get("title", "")).startswith("lagcli model")
