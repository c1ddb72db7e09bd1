"""`lagcli limit`: a holonomic row as a stiff spring, and how its force tends to the multiplier."""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated

from lagcli.cli.commands import completing, options
from lagcli.cli.terminal import console, exits
from lagcli.model.settings import RunSettings
from lagcli.output.files import formats, write_guard

if TYPE_CHECKING:
    from lagcli.formulations.stiff_ladder import StiffLimit


@options.command("method")
def limit(
    model: options.ModelArgument,
    constraint: Annotated[
        str, options.named("NAME", "the holonomic row that becomes a spring", completing.holonomic)
    ],
    stiffness: Annotated[
        str | None, options.named("LOW:HIGH", "stiffnesses, two a decade (1e3:1e5); LOW:HIGH:COUNT")
    ] = None,
    unprestressed: Annotated[bool, "start without stretch, not on the slow motion"] = False,
    ramp: Annotated[
        float | None, options.named("SECONDS", "one run in which k rises over all of them")
    ] = None,
    output: Annotated[str | None, options.output("table; - for standard output")] = None,
    plot: Annotated[str | None, options.file("figure of forces and errors: png, svg, pdf")] = None,
    *,
    run_settings: RunSettings,
    changes: options.SetOption = None,
    as_json: options.JsonOption = False,
    quiet: options.QuietOption = False,
    verbose: options.VerboseOption = False,
) -> None:
    """Replace a holonomic row f = 0 by the potential k f^2/2 for growing k, and set its force -k f against lambda.

    Runs start on the slow motion, where the spring pulls as the row does, and the error goes as 1/k. Exit 3 where a run
    stops before its end.
    """
    options.require_models([model])
    write_guard.require_outputs(model, output, plot, as_json)
    read = options.read(model, changes, as_json, verbose)
    given: options.Keywords = {"constraint": constraint, "unprestressed": unprestressed, "ramp": ramp}
    given |= run_settings
    if stiffness:
        given["stiffness"] = stiffness
    if not quiet:
        given["told"] = lambda sentence: exits.print_err(f"note: {sentence}")
    from lagcli.api import limit as limiting

    with options.refusals(as_json, lambda text: f"--{text}" if text.startswith("constraint") else text):
        found, lines = limiting.limit_to_files(read, given, output, plot)
    exits.print_err_all(lines)
    if as_json:
        print(formats.json_line(found.as_json()))
    elif output != "-":
        is_weighted = found.rate_of == "weighted_mean"
        rows = []
        for one in found.rungs:
            mean = "" if one.mean_error is None else f"{one.mean_error:.6g}"
            apart = "" if one.mean_uncertainty is None else f"{one.mean_uncertainty:.2g}"
            weighted = "" if one.weighted_mean is None else f"{one.weighted_mean:.6g}"
            row = [f"{one.stiffness:.6g}", f"{one.max_error:.6g}", mean, apart]
            row += [weighted] if is_weighted else []
            rows.append([*row, f"{one.uncertainty:.2g}", "" if one.steps is None else str(one.steps)])
        if rows:
            headers = ["k", "largest error", "mean error", "±"]
            headers += ["mean without swings"] if is_weighted else []
            console.table([*headers, "tolerance", "steps"], rows, {})
            print()
        console.paragraph(sentence(found))
    ended = (f"the ladder ends there: {found.ended}",) if found.ended else ()
    exits.print_notes((*found.notes, *ended), quiet)
    if found.stopped:
        exits.print_err(f"lagcli: {found.stopped}")
        raise exits.Exit(exits.STOPPED)


def sentence(found: StiffLimit) -> str:
    """The outcome in words."""
    name = f"-k f of `{found.constraint}`"
    if not found.rungs:
        return f"there is no stiff run of `{found.constraint}` to be compared"
    what = "mean without swings" if found.rate_of == "weighted_mean" else "largest error"
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
        uncertainty = "" if found.rate.error is None else f" ± {found.rate.error:.2g}"
        rate = f"its {what} goes as k^({found.rate.slope:.4f}{uncertainty})"
    return f"{name}, started {start}, against lambda: {rate}"
