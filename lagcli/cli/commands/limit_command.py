"""`lagcli limit`: a holonomic row as a stiff spring, and how its force tends to the multiplier."""

from __future__ import annotations

import dataclasses
import pathlib
from typing import TYPE_CHECKING, Annotated

import typer

from lagcli.cli.commands import completing, model_reading, options
from lagcli.cli.terminal import console, exits
from lagcli.output.files import file_requests, json_text, write_guard

if TYPE_CHECKING:
    from lagcli.formulations.stiff_ladder import StiffLimit
    from lagcli.model.model import Model
    from lagcli.output.figures.limit_figure import LimitCurves


@exits.command
def limit(
    model: options.ModelArgument,
    constraint: Annotated[
        str,
        typer.Option(
            "--constraint",
            metavar="NAME",
            help="the holonomic row that becomes a spring",
            autocompletion=completing.holonomic,
        ),
    ],
    stiffness: Annotated[
        str | None,
        typer.Option(metavar="LOW:HIGH", help="stiffnesses, two a decade (1e3:1e5); LOW:HIGH:COUNT"),
    ] = None,
    unprestressed: Annotated[
        bool, typer.Option("--unprestressed", help="start without stretch, not on the slow motion")
    ] = False,
    ramp: Annotated[
        float | None,
        typer.Option("--ramp", metavar="SECONDS", help="one run in which k rises over all of them"),
    ] = None,
    output: Annotated[
        str | None, typer.Option("-o", "--output", metavar="FILE", help="table; - for standard output")
    ] = None,
    plot: Annotated[
        str | None, typer.Option("--plot", metavar="FILE", help="figure of forces and errors: png, svg, pdf")
    ] = None,
    duration: options.RunsDurationOption = None,
    output_step: options.OutputStepOption = None,
    samples: Annotated[int | None, typer.Option(help="number of rows, both ends counted")] = None,
    rtol: options.RunsRtolOption = None,
    atol: options.RunsAtolOption = None,
    max_step: options.RunsMaxStepOption = None,
    assemble: options.AssembleOption = False,
    changes: options.SetOption = None,
    as_json: options.JsonOption = False,
    quiet: options.QuietOption = False,
    verbose: options.VerboseOption = False,
    debug: options.DebugOption = False,
) -> None:
    """Replace a holonomic row f = 0 by the potential k f^2/2 for growing k, and set its force -k f against lambda.

    Runs start on the slow motion, where the spring pulls as the row does, and the error goes as 1/k. Exit 3 where a run
    stops before its end.
    """
    model_reading.require_models([model])
    asked = LimitOptions(constraint, stiffness, unprestressed, ramp, output, plot, as_json, quiet)
    asked.require(model)
    read = model_reading.read(model, changes, as_json, verbose)
    given: options.RunSettings = {
        "duration": duration, "output_step": output_step, "samples": samples, "rtol": rtol, "atol": atol,
        "max_step": max_step, "assemble": True if assemble else None,
    }  # fmt: skip
    model_reading.reported(lambda: carry_out(read, given, asked), as_json)


@dataclasses.dataclass(frozen=True, slots=True, eq=False)
class LimitOptions:
    """Options of `limit` besides the settings of the runs."""

    constraint: str
    stiffness: str | None
    unprestressed: bool
    ramp: float | None
    output: str | None
    plot: str | None
    as_json: bool
    quiet: bool

    def require(self, model: str) -> None:
        """Refuse what cannot be done with this MODEL."""
        file_requests.require_outputs(model, self.output, self.plot, self.as_json)


def carry_out(model: Model, settings: options.RunSettings, options: LimitOptions) -> None:
    """Make the runs and print the result. Raises `exits.UsageError`, `exits.Exit` where a run stopped."""
    from lagcli.api import limit as limiting

    try:
        found = limiting.limit(
            model,
            options.constraint,
            stiffness=options.stiffness or limiting.STIFFNESS,
            unprestressed=options.unprestressed,
            ramp=options.ramp,
            told=None if options.quiet else lambda sentence: exits.print_err(f"note: {sentence}"),
            **settings,
        )
    except ValueError as error:
        raise exits.UsageError(f"--{error}" if str(error).startswith("constraint") else str(error)) from None
    _write(model, found, options)
    if options.as_json:
        print(json_text.text(found.as_json()))
    elif options.output != "-":
        _print_report(found)
    if not options.quiet:
        exits.print_err_all(f"note: {note}" for note in found.notes)
        if found.ended:
            exits.print_err(f"note: the ladder ends there: {found.ended}")
    if found.stopped:
        exits.print_err(f"lagcli: {found.stopped}")
        raise exits.Exit(exits.STOPPED)


def _print_report(found: StiffLimit) -> None:
    rows = [
        [
            f"{one.stiffness:.6g}",
            f"{one.max_error:.6g}",
            "" if one.mean_error is None else f"{one.mean_error:.6g}",
            "" if one.mean_uncertainty is None else f"{one.mean_uncertainty:.2g}",
            f"{one.uncertainty:.2g}",
            "" if one.steps is None else str(one.steps),
        ]
        for one in found.rungs
    ]
    if rows:
        console.table(["k", "largest error", "mean error", "±", "tolerance", "steps"], rows, {})
        print()
    console.paragraph(sentence(found), "    ")


def sentence(found: StiffLimit) -> str:
    """The outcome in words."""
    name = f"-k f of `{found.constraint}`"
    if not found.rungs:
        return f"there is no stiff run of `{found.constraint}` to be compared"
    what = "mean" if found.rate_of == "mean_error" else "largest error"
    start = "on the slow motion" if found.start == "adapted" else "without stretch"
    if found.ramp is not None:
        last, seconds = found.rungs[-1], found.ramp["seconds"]
        return (
            f"k rose from {found.ramp['from']:g} to {found.ramp['to']:g} in {seconds:g} s: {name}, started {start}, is"
            f" in the end off lambda by {last.mean_error:.3g} in the mean and by {last.max_error:.3g} at most"
        )
    last = found.rungs[-1]
    if found.rate is None and last.max_error <= last.uncertainty:
        return f"{name}, started {start}, is lambda as far as tolerance and rounding tell: to {last.max_error:.2g}"
    if found.rate is None:
        rate = "no rate can be fitted"
    else:
        doubt = "" if found.rate.error is None else f" ± {found.rate.error:.2g}"
        rate = f"its {what} goes as k^({found.rate.slope:.4f}{doubt})"
    return f"{name}, started {start}, against lambda: {rate}"


def _write(model: Model, found: StiffLimit, options: LimitOptions) -> None:
    """The table and the figure that were asked for."""
    from lagcli.output.runs import safe_table
    from lagcli.output.runs.safe_table import TablePlan
    from lagcli.output.tables import provenance

    if options.output is not None:
        names, rows = found.table
        whence = provenance.of(model).as_json() | {"limit": {"constraint": found.constraint}}
        plan = TablePlan("--output", None if options.output == "-" else options.output, names)
        with safe_table.opened(plan, whence) as table:
            table.write(rows)
            if found.stopped:
                saved = table.keep()
                exits.print_err(f"lagcli: {saved}" if saved else "lagcli: a run stopped")
            else:
                table.complete()
    if options.plot is not None and found.rungs:
        with write_guard.drawing(options.plot):
            # matplotlib takes a third of a second to load: only where a figure is asked for.
            from lagcli.output.figures import limit_figure

            title = f"{model.title or pathlib.Path(model.path).stem}: `{found.constraint}` as a stiff spring"
            limit_figure.draw(options.plot, _curves(found), title, model.units.time)


def _curves(found: StiffLimit) -> LimitCurves:
    """The curves of the figure."""
    import numpy as np

    from lagcli.output.figures.limit_figure import LimitCurves

    rungs = found.rungs
    if found.force is not None:
        forces = [("-k f as k rises", found.force)]
    else:
        ends = [rungs[0], rungs[-1]] if len(rungs) > 1 else [rungs[0]]
        forces = [(f"-k f, k = {one.stiffness:.3g}", one.force) for one in ends]
    by_mean = found.rate_of == "mean_error"
    errors = [(one.stiffness, (one.mean_error or 0.0) if by_mean else one.max_error) for one in rungs]
    k = np.array([one.stiffness for one in rungs])
    rate = "" if found.rate is None else f", slope {-found.rate.slope:.3f}".replace("-", "−")
    return LimitCurves(
        found.constraint,
        found.t,
        found.multiplier,
        forces,
        np.array([(one.stiffness, one.force.min(), one.force.max()) for one in rungs]),
        np.array(errors),
        None if found.rate is None else found.rate.line(k),
        rate,
        "mean error" if by_mean else "largest error",
    )
