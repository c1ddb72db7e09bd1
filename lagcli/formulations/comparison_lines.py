"""A comparison in words: its table, how to read it, and where formulations disagree."""

from __future__ import annotations

import dataclasses

from lagcli.formulations.comparison import KINDS, TITLES, Comparison

LABELS = {"lambda": "λ"}


@dataclasses.dataclass(frozen=True, slots=True)
class ComparisonLines:
    """The table of the formulations with its headers, and sentences, each of which may be nothing: how to read the
    table, how the two principles compare, and where formulations differ more than they may."""

    headers: list[str]
    rows: list[list[str]]
    agreement: str
    principles: str
    disagreement: str
    is_stopped: bool


def of(found: Comparison) -> ComparisonLines:
    """The words of a comparison."""
    several = len({one.path for one in found.formulations}) > 1
    shown = [kind for kind in KINDS if any(kind in each for each in found.agreements)]
    headers = [*(["model"] if several else []), "formulation", "dof", "rows", "steps", "seconds"]
    headers += [LABELS.get(kind, kind) for kind in shown]
    rows = []
    for one, agreement in zip(found.formulations, ({}, *found.agreements), strict=True):
        cells = [one.path] if several else []
        cells += [TITLES[one.name], str(one.freedoms), str(one.rows), str(one.steps), f"{one.seconds:.3f}"]
        rows.append(
            [*cells, *(f"{agreement[kind].digits:.1f}" if kind in agreement else "" for kind in shown)]
        )
    return ComparisonLines(
        headers,
        rows,
        "" if found.agree is None else _agreement(found),
        "" if found.principles is None else found.principles.sentence,
        _disagreement(found) if found.agree is False else "",
        found.stopped,
    )


def _agreement(found: Comparison) -> str:
    verdict = f"{'all' if found.agree else 'not all'} within {found.tolerance:g}" if found.judged else ""
    return f"digits that agree with the first line, of the largest value of each kind; {verdict}"


def _disagreement(found: Comparison) -> str:
    """A line that says when and in which column the formulations differ most."""
    one, worst = max(
        (
            (one, agreement)
            for one, each in zip(found.formulations[1:], found.judged, strict=False)
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
