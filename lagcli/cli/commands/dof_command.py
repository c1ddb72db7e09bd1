"""`lagcli dof`: the number of degrees of freedom."""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated

from lagcli.cli.commands import options
from lagcli.cli.terminal import exits
from lagcli.model import settings
from lagcli.output.files import formats

if TYPE_CHECKING:
    from lagcli.analysis.dof import DofCount


@options.command()
def dof(
    model: options.ModelArgument,
    changes: options.SetOption = None,
    as_json: options.JsonOption = False,
    explain: Annotated[bool, "show the count line by line"] = False,
    limit: options.LimitOption = settings.LIMIT,
    quiet: options.QuietOption = False,
    verbose: options.VerboseOption = False,
) -> None:
    """Print the number of degrees of freedom, 3N - s (n - s with generalized coordinates).

    Exit 4 and nothing on standard output where it is not decided.
    """
    from lagcli.api import count_dof

    read = options.read(model, changes, as_json)
    with options.json_errors(as_json):
        counted = count_dof.dof(read, limit=limit)
    if as_json:
        print(formats.json_line(counted.as_json()))
    elif explain:
        print("\n".join(_lines(counted)))
    elif counted.configuration_dof is not None:
        print(counted.configuration_dof)
    exits.print_notes(counted.notes, quiet or explain)
    if verbose:
        exits.print_warnings(read.warnings)
        exits.print_err_all(() if explain else _lines(counted))
    if counted.configuration_dof is None:
        low, high = counted.bounds
        exits.print_err(f"lagcli: undecided, between {low} and {high}: {counted.reason}")
        raise exits.Exit(exits.UNDECIDED)


def _lines(counted: DofCount) -> list[str]:
    from lagcli.analysis import check_report  # here, as a number alone needs none of them

    return check_report.count(counted)
