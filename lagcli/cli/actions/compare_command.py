"""`lagcli compare`: formulations side by side, with the digits to which they agree."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping, Sequence

from lagcli.api import compare
from lagcli.api.runs.run_settings import RepeatedRuns
from lagcli.cli.files import principles_output
from lagcli.cli.files.principles_output import PrinciplesOptions
from lagcli.cli.terminal import console, exits
from lagcli.formulations import comparison
from lagcli.formulations.comparison import KINDS, TITLES, Agreement, Comparison
from lagcli.model.model import Model
from lagcli.output.files import json_text

LABELS = {"lambda": "λ"}
COLOURS = {"stopped": "red"}


@dataclasses.dataclass(frozen=True, slots=True, eq=False)
class CompareOptions:
    """Options of `compare` besides the settings of the runs."""

    columns: str | None
    tolerance: float | None
    as_json: bool
    quiet: bool
    principles: PrinciplesOptions


def run(model: Model, other: Model | None, settings: RepeatedRuns, options: CompareOptions) -> None:
    """Compare and print the result. Raises `exits.UsageError`, `exits.Exit` where they disagree or a run stopped."""
    try:
        found = compare.compare(
            model,
            other,
            columns=options.columns or "*",
            tolerance=comparison.TOLERANCE if options.tolerance is None else options.tolerance,
            vakonomic=options.principles.vakonomic,
            mu=principles_output.initial_multipliers(options.principles.mu),
            **settings,
        )
    except ValueError as error:
        raise exits.UsageError(str(error)) from None
    principles_output.write(model, found, options.principles)
    if options.as_json:
        print(json_text.text(found.as_json()))
    elif options.principles.output == "-":
        if found.principles is not None:
            exits.print_err(found.principles.sentence)
    else:
        _print_report(found)
    if not options.quiet:
        exits.print_err_all(f"note: {note}" for note in found.notes)
    if found.agree is False:
        exits.print_err(f"lagcli: {_disagreement(found)}")
        raise exits.Exit(exits.INVALID)
    if found.stopped:
        raise exits.Exit(exits.STOPPED)


def _print_report(found: Comparison) -> None:
    several = len({one.path for one in found.formulations}) > 1
    shown = [kind for kind in KINDS if any(kind in each for each in found.agreements)]
    headers = [*(["model"] if several else []), "formulation", "dof", "rows", "steps", "seconds"]
    headers += [LABELS.get(kind, kind) for kind in shown]
    rows = []
    for one, agreement in zip(found.formulations, ({}, *found.agreements), strict=True):
        cells = [one.path] if several else []
        cells += [TITLES[one.name], str(one.freedoms), str(one.rows), str(one.steps), f"{one.seconds:.3f}"]
        rows.append([*cells, *(_digits(agreement, kind) for kind in shown)])
    console.table(headers, rows, COLOURS)
    if found.agree is not None:
        print()
        console.paragraph(_agreement(found), "    ")
    if found.principles is not None:
        print()
        console.paragraph(found.principles.sentence, "    ")


def _agreement(found: Comparison) -> str:
    """A sentence on how to read the table."""
    verdict = (
        f"{'all' if found.agree else 'not all'} within {found.tolerance:g}"
        if _of_one_principle(found)
        else ""
    )
    return f"digits that agree with the first line, of the largest value of each kind; {verdict}"


def _digits(agreement: Mapping[str, Agreement], kind: str) -> str:
    return f"{agreement[kind].digits:.1f}" if kind in agreement else ""


def _of_one_principle(found: Comparison) -> Sequence[Mapping[str, Agreement]]:
    """The agreements that are judged: that the other principle differs is an answer."""
    return found.agreements if found.principles is None else found.agreements[:-1]


def _disagreement(found: Comparison) -> str:
    """When and in which column the formulations differ most."""
    one, worst = max(
        (
            (one, agreement)
            for one, each in zip(found.formulations[1:], _of_one_principle(found), strict=False)
            for agreement in each.values()
        ),
        key=lambda pair: pair[1].error,
    )
    first = found.formulations[0]
    sides = (first.path, one.path) if one.path != first.path else (TITLES[first.name], TITLES[one.name])
    return (
        f"{sides[0]} and {sides[1]} disagree: `{worst.column}` by {worst.error:.3g} of the largest value of its kind"
        f" at t = {worst.t:.9g}, where {found.tolerance:g} passes"
    )
