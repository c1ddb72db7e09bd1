"""Options that several commands have."""

from __future__ import annotations

import functools
import inspect
import math
import typing
from collections.abc import Callable
from typing import Annotated, Any, TypeAlias

import typer

from lagcli.cli.commands import completing
from lagcli.model import settings
from lagcli.output.files import formats


def _seconds(context: typer.Context, option: typer.CallbackParam, value: float) -> float:
    """A limit as it is, or that of nobody. Raises `typer.BadParameter` for nan, which no lower bound refuses."""
    if math.isnan(value):
        raise typer.BadParameter("must be a number of seconds, not nan")
    source = context.get_parameter_source(option.name or "")
    return settings.LIMIT if source is None or source.name == "DEFAULT" else value


Keywords: TypeAlias = dict[str, Any]  # of a function of the API
# Of settings that are names.
_COMPLETIONS: Keywords = {"method": completing.methods}


def with_run_settings(*left_out: str) -> Callable[[Callable[..., None]], Callable[..., None]]:
    """Give a command an option for each setting of a run, but for those left out.

    It takes them together as `run_settings`; one that is not given is None there, and as the model says.
    """

    def with_options(function: Callable[..., None]) -> Callable[..., None]:
        hints = typing.get_type_hints(function, include_extras=True)
        rows = {
            name: row for name, row in settings.table().items() if row[1].is_option and name not in left_out
        }
        parameters: list[inspect.Parameter] = []
        for parameter in inspect.signature(function).parameters.values():
            if parameter.name == "run_settings":
                parameters += [_option(name, *row) for name, row in rows.items()]
            else:
                parameters.append(parameter.replace(annotation=hints[parameter.name]))

        @functools.wraps(function)
        def called(**given: object) -> None:
            chosen = {name: given.pop(name) for name in rows}
            # A flag that is not set is no `assemble: false`.
            chosen |= {name: None for name, value in chosen.items() if value is False}
            function(**given, run_settings=chosen)

        called.__signature__ = inspect.Signature(parameters)  # type: ignore[attr-defined]
        called.__annotations__ = {each.name: each.annotation for each in parameters}
        return called

    return with_options


def _option(name: str, kind: object, row: settings.RunSetting) -> inspect.Parameter:
    """One setting, with values of this type, as an option."""
    flag = f"--{name.replace('_', '-')}"
    one_of = f": {row.holds.replace('`', '')}" if kind is str else ""
    help_line = row.meaning.replace("`samples`", "--samples") + one_of
    names = {"metavar": "NAME", "autocompletion": _COMPLETIONS[name]} if kind is str else {}
    option = typer.Option(flag, help=help_line, **names)
    hint = bool if kind is bool else settings.keyword_types()[name]
    default = False if kind is bool else None
    annotation = Annotated[hint, option]  # type: ignore[valid-type]
    return inspect.Parameter(name, inspect.Parameter.KEYWORD_ONLY, default=default, annotation=annotation)


ModelArgument = Annotated[
    str,
    typer.Argument(
        metavar="MODEL", help="model file; - for standard input", autocompletion=completing.model_files
    ),
]
SetOption = Annotated[
    list[str] | None,
    typer.Option(
        "--set",
        metavar="NAME=EXPR",
        help="a different value for a parameter (m=2) or a start (theta.value=pi/3, a.z=-1); repeatable",
        autocompletion=completing.settings,
    ),
]
JsonOption = Annotated[bool, typer.Option("--json", help="JSON on standard output, errors too")]
LimitOption = Annotated[
    float,
    typer.Option("--limit", metavar="SECONDS", min=0.0, callback=_seconds, help="processor time for proofs"),
]
AssembleOption = Annotated[
    bool, typer.Option("--assemble", help=settings.table()["assemble"][1].meaning)
]  # of commands that make no run
QuietOption = Annotated[bool, typer.Option("-q", "--quiet", help="only errors on standard error")]
VerboseOption = Annotated[bool, typer.Option("-v", "--verbose", help="more on standard error")]
DebugOption = Annotated[bool, typer.Option("--debug", help="a traceback where lagcli itself fails")]
PointsOption = Annotated[
    str | None,
    typer.Option("-o", "--output", metavar="FILE", help=f"the points: {formats.LISTED}; -"),
]
StartsOption = Annotated[int, typer.Option("--starts", min=0, help="starts beside the declared one")]
SeedOption = Annotated[int, typer.Option("--seed", min=0, help="of these starts; the same for the same seed")]
FromOption = Annotated[
    str | None,
    typer.Option("--from", metavar="FILE[:ROW]", help="start from a row of a table; by default the last"),
]
ForceOption = Annotated[bool, typer.Option("--force", help="write over a file that is there")]
NoSchemaOption = Annotated[
    bool, typer.Option("--no-schema", help="no schema for editors beside it, and no line that names it")
]
WatchOption = Annotated[
    bool, typer.Option("--watch", help="run again at each change of the file, until Ctrl-C")
]
