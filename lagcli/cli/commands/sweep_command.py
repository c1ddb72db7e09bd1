"""`lagcli sweep`: many runs of one model, a row each."""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated, NoReturn

import typer

from lagcli.cli.commands import completing, options
from lagcli.cli.terminal import console, exits
from lagcli.model import settings
from lagcli.model.settings import RunSettings
from lagcli.output.files import formats

if TYPE_CHECKING:
    from lagcli.output.sweeps.sweep_table import SweepEnding


@options.command()
def sweep(
    models: Annotated[
        list[str],
        options.argument(
            "MODEL", "model file; - for standard input; with --merge the files", completing.model_files
        ),
    ],
    over: Annotated[
        list[str] | None, options.named("NAME=VALUES", "LOW:HIGH:COUNT or [V1, V2, ...]; several are a grid")
    ] = None,
    points: Annotated[str | None, options.file("a table, a point a row; - for standard input, CSV")] = None,
    uncertain: Annotated[
        list[str] | None, options.named("NAME~LAW", "normal(MEAN, SD), uniform(LOW, HIGH), ...; repeatable")
    ] = None,
    draws: Annotated[int, typer.Option(min=1, help="points that are drawn of --uncertain")] = 1024,
    seed: options.SeedOption = 0,
    sampling: Annotated[str, options.named("KIND", "sobol, quasi-random, or random")] = "sobol",
    reduce: Annotated[
        list[str] | None, options.named("NAME=EXPR", "kept of a run: 'peak=max(abs(lambda.rod))'; repeatable")
    ] = None,
    output: Annotated[
        str | None, options.output("a table, FOLDER/ for a Parquet dataset; - for stdout")
    ] = None,
    tables: Annotated[
        str | None, options.named("FOLDER", "every full table, FOLDER/*.parquet for another format than CSV")
    ] = None,
    jobs: Annotated[int, typer.Option(min=1, help="processes of this machine")] = 1,
    scheduler: Annotated[
        str | None, options.named("ADDRESS", "a Dask cluster instead, tcp://HOST:PORT")
    ] = None,
    shard: Annotated[str | None, options.named("I/N", "the I-th of N parts of the points")] = None,
    merge: Annotated[bool, "the arguments are tables of shards: put them together"] = False,
    resume: Annotated[bool, "go on from the rows of an ended sweep into FILE"] = False,
    limit_each: Annotated[
        float | None, typer.Option(metavar="SECONDS", min=0.0, help="a point that takes longer is ended")
    ] = None,
    yes: Annotated[bool, "also for more than ten million points"] = False,
    *,
    run_settings: RunSettings,
    limit: options.LimitOption = settings.LIMIT,
    changes: options.SetOption = None,
    as_json: options.JsonOption = False,
    quiet: options.QuietOption = False,
) -> None:
    """Run a model at many points and write a row for each: the point, what is kept of the run, how it ended.

    The points are a grid (--over), a table (--points), draws (--uncertain), or every one of the former with every
    draw. Each row is that of `simulate --set`, to the last bit, whatever computes it. Exit 1 where a point is invalid,
    else 3 where one stopped; all have a row. Rows are safe as they come: --resume goes on after any end.
    """
    from lagcli.api import sweep as sweeping
    from lagcli.output.sweeps import written_sweep

    request = written_sweep.SweepRequest(output, tables, shard, scheduler, jobs, resume, as_json, quiet)
    if merge:
        asked = (over, points, uncertain, reduce, tables, shard, scheduler, changes)
        if any(asked) or resume:
            raise exits.UsageError("--merge puts tables together that are there: it goes with -o FILE alone")
        _end(written_sweep.write_merged(models, request), quiet)
    if len(models) > 1:
        raise exits.UsageError(
            "a sweep is of one MODEL; with --merge the arguments are the tables of its shards"
        )
    request.require(models[0], points)
    computed = sweeping.AskedSweep(
        tuple(over or ()), points, tuple(uncertain or ()), draws, seed, sampling, yes,
        tuple(reduce or ()), run_settings, limit, limit_each,
    )  # fmt: skip
    read = options.read(models[0], changes, as_json)
    ending: SweepEnding | None = None
    with options.json_errors(as_json), console.progress(0.0, 1.0, quiet) as bar:
        for step in sweeping.steps(read, computed, request):
            if isinstance(step, float):
                bar.at(step)
            elif isinstance(step, str):
                exits.print_err(step)
            else:
                ending = step
    assert ending is not None
    _end(ending, quiet)


def _end(ending: SweepEnding, quiet: bool) -> NoReturn:
    """Tell the ending. Raises `exits.Exit` with 1 or 3 where a point is not done."""
    if ending.account is not None:
        print(formats.json_line(ending.account))
    exits.print_err_all(() if quiet else ending.messages)
    raise exits.Exit(ending.code)
