"""Options that several commands have."""

from __future__ import annotations

import math
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
QuietOption = Annotated[bool, typer.Option("-q", "--quiet", help="only errors on standard error")]
VerboseOption = Annotated[bool, typer.Option("-v", "--verbose", help="more on standard error")]
DebugOption = Annotated[bool, typer.Option("--debug", help="a traceback where lagcli itself fails")]
AssembleOption = Annotated[
    bool, typer.Option("--assemble", help="move the start to the nearest consistent state")
]
OutputStepOption = Annotated[float | None, typer.Option("--output-step", help="time between rows")]
RunSettings: TypeAlias = dict[str, Any]  # keywords of a function of the API, None where the file's stays
# Of one run.
DurationOption = Annotated[float | None, typer.Option(help="length of the run")]
SamplesOption = Annotated[int | None, typer.Option(help="number of rows, both ends counted")]
RtolOption = Annotated[float | None, typer.Option(help="relative tolerance")]
AtolOption = Annotated[float | None, typer.Option(help="absolute tolerance")]
MethodOption = Annotated[str | None, typer.Option(metavar="NAME", help=" or ".join(settings.METHODS))]
# Of runs that a command makes several of.
RunsDurationOption = Annotated[float | None, typer.Option(help="length of the runs")]
RunsRtolOption = Annotated[float | None, typer.Option(help="relative tolerance of the runs")]
RunsAtolOption = Annotated[float | None, typer.Option(help="absolute tolerance of the runs")]
RunsMaxStepOption = Annotated[float | None, typer.Option("--max-step", help="no step of the runs is longer")]
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
