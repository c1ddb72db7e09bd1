"""Rows at a consistent state -> the codimension of the surface they cut out, as far as it is proved; and the refusals
of rows that no run can be stepped with, with advice."""

from __future__ import annotations

import dataclasses
import functools
from collections.abc import Callable, Iterable, Sequence
from typing import TYPE_CHECKING, Literal

import numpy as np

from lagcli.compiled import NumericSystem
from lagcli.equations.system import System
from lagcli.errors import diagnostics
from lagcli.frozen import frozen_value
from lagcli.linear import independent_rows, metric_rows, rank
from lagcli.linear.metric_rows import MetricRows, Sparse
from lagcli.start import initial, projection
from lagcli.start.initial import State
from lagcli.start.precise_rows import PreciseRows

if TYPE_CHECKING:
    # Of most models all rows are independent: what examines others is loaded where it is asked.
    from lagcli.analysis.codimension.scaled_equations import ScaledPart

Rows = list[int]
Kind = Literal["independent", "redundant", "singular", "deficient", "undecided"]

ORDER: tuple[Kind, ...] = ("independent", "redundant", "singular", "deficient", "undecided")
TOGETHER = 30  # rows of small groups that are looked at together
# The proof that rows follow from others looks at all rows of the model, again and again: of more than so many it
# takes minutes.
MOST_DEPENDENCIES = 3000
# A fixed one: the advice must not change from run to run.
SEED = 20061


@frozen_value
class Codimension:
    """The rank of the holonomic rows at a state, and the codimension of their surface around it, None if unproved.

    kind, the last of these where sets of rows are of several kinds: `independent` and `redundant` rows, of which the
    rank is the codimension; `singular`: the rank is lower at the state than on the surface nearby; `deficient`: it is
    below the codimension around the state, and the multiplier rule fails; `undecided`, with the `reason`.
    rows: those of the sets of this kind that depend on one another. coordinates: those of all rows around them.
    follow: rows proved to follow from the others. notes: sentences on sets whose rank is below their codimension.
    """

    kind: Kind
    rank: int
    codimension: int | None
    rows: tuple[int, ...] = ()
    coordinates: tuple[int, ...] = ()
    follow: tuple[int, ...] = ()
    reason: str = ""
    notes: tuple[str, ...] = ()


def examine(system: System, numeric: NumericSystem, state: State) -> Codimension:
    """The codimension of f = 0 around a state on it. Of independent rows at once."""
    B = numeric.holonomic(state.t, state.q, state.p)[1]
    rows = MetricRows(B, initial.metric_at(numeric, state), PreciseRows(numeric, state).rank)
    found = rank.estimate(rows)
    if found.low == rows.count:
        return Codimension("independent", rows.count, rows.count)
    if found.value is None:
        part = {i for vector in found.dependences for i in rank.participants(vector)}
        limits = rank.PARAMETERS
        reason = (
            "no gap in the singular values of the constraint rows decides their rank:"
            f" {found.high - found.low} of them lie between {limits.small:g} and {limits.large:g},"
            " as those of a very long structure in bending do"
        )
        return Codimension("undecided", found.low, None, tuple(sorted(part)), reason=reason)
    from lagcli.analysis.codimension import scaled_equations

    chosen = independent_rows.dependence(rows, found.value).selection
    # Parts of the rows, which are looked at again at later times
    later, part_of = initial.later(system), functools.partial(scaled_equations.part, system, numeric, state)
    case = part_of, (state.t + later / 10, state.t + later) if later else ()
    independent = set(chosen.independent)
    parts = [among for among in _around(B, set()) if not independent.issuperset(among)]
    follow, failing = _followed(*case, [parts] if rows.is_large else _batches(parts), independent)
    several = {i for part in failing for i in part}
    dependencies = [dependency for dependency in chosen.dependencies if several.issuperset(dependency)]
    if len(dependencies) > MOST_DEPENDENCIES:
        left_out = tuple(dependency[0] for dependency in dependencies)
        such_as = initial.names_of(system, left_out[:1])
        reason = (
            f"{len(left_out)} rows depend on others at the start, such as {such_as}:"
            f" that they follow from them is proved of {MOST_DEPENDENCIES} rows at most"
        )
        return Codimension("undecided", found.value, None, left_out, reason=reason)
    # Of a part that does not follow as a whole some groups may, and of a group some dependencies.
    for smaller in (connected(dependencies), [sorted(dependency) for dependency in dependencies]):
        tried = [group for group in smaller if group not in failing and several.issuperset(group)]
        more, _ = _followed(*case, _batches(tried), independent)
        follow = sorted({*follow, *more})
        # Where all that is left of a group is independent, all of it follows from that.
        failing = [
            rest
            for group in connected(dependencies)
            if not independent.issuperset(rest := sorted(set(group) - set(follow)))
        ]
        several = {i for group in failing for i in group}
    dependent = sorted({i for dependency in chosen.dependencies for i in dependency})
    sets = [Codimension("redundant", 0, 0, tuple(dependent), (), tuple(follow))]
    for among in _around(B, set(follow)) if failing else ():
        some = tuple(sorted({i for group in failing for i in group}.intersection(among)))
        if some:
            sets.append(_examined(*case, among, some, independent))
    flat = {dependency[0] for dependency in chosen.dependencies if len(dependency) == 1}
    return _joined(system, found.value, sets, flat)


def _around(B: Sparse, without: set[int]) -> list[Rows]:
    """Rows that share coordinates, one set for each connected part."""
    rows = metric_rows.LocalRows(B)
    pairs = [(i, rows.count + j) for i, j in zip(rows.row.tolist(), rows.column.tolist(), strict=True)]
    alone = [(i,) for i in range(rows.count) if i not in without]
    parts = connected([*alone, *(pair for pair in pairs if pair[0] not in without)])
    return [among for part in parts if (among := [i for i in part if i < rows.count])]


def connected(sets: Iterable[Sequence[int]]) -> list[Rows]:
    """Sets joined where they share a member, each in order."""
    head: dict[int, int] = {}

    def top(i: int) -> int:
        while head.setdefault(i, i) != i:
            head[i] = head[head[i]]
            i = head[i]
        return i

    for first, *others in sets:
        top(first)
        for other in others:
            head[top(other)] = top(first)
    found: dict[int, Rows] = {}
    for i in sorted(head):
        found.setdefault(top(i), []).append(i)
    return list(found.values())


def _followed(
    part_of: Callable[[Rows], ScaledPart],
    times: Sequence[float],
    lots: list[list[Rows]],
    independent: set[int],
) -> tuple[Rows, list[Rows]]:
    """Rows that follow from the independent ones of their group alone, and the groups of which that is not shown.
    Groups are looked at together in lots, and of a lot that does not follow as a whole the halves."""
    from lagcli.analysis.codimension import manifold, scaled_equations

    follow: Rows = []
    failing: list[Rows] = []
    for several in lots:
        rows = sorted({i for group in several for i in group})
        part = part_of(rows)
        chosen = [k for k, i in enumerate(part.rows) if i in independent]
        is_seen = part.is_large or len(rows) <= metric_rows.PARAMETERS.dense
        is_seen = is_seen and scaled_equations.is_smooth(part)
        if is_seen and manifold.is_regular(part, len(chosen), times, chosen):
            follow += [i for i in rows if i not in independent]
        elif len(several) == 1:
            failing += several
        else:
            halves = [several[: len(several) // 2], several[len(several) // 2 :]]
            some, others = _followed(part_of, times, halves, independent)
            follow, failing = follow + some, failing + others
    return sorted(follow), failing


def _batches(groups: list[Rows]) -> list[list[Rows]]:
    """Groups in lots of a few rows."""
    lots: list[list[Rows]] = []
    rows: set[int] = set()
    for group in groups:
        if not lots or len(rows.union(group)) > TOGETHER:
            lots.append([])
            rows = set()
        lots[-1].append(group)
        rows.update(group)
    return lots


def _examined(
    part_of: Callable[[Rows], ScaledPart],
    times: Sequence[float],
    among: Rows,
    some: tuple[int, ...],
    independent: set[int],
) -> Codimension:
    """Examine rows that share coordinates, of which `some` depend on one another."""
    from lagcli.analysis.codimension import manifold, scaled_equations, second_order

    row_rank = len(independent.intersection(among))
    unknown = Codimension("undecided", row_rank, row_rank, some)
    if len(among) > metric_rows.PARAMETERS.dense:
        return unknown
    part = part_of(among)
    unknown = dataclasses.replace(unknown, coordinates=tuple(part.coordinates))
    if not scaled_equations.is_smooth(part):
        return unknown
    if manifold.is_regular(part, row_rank, times):
        follow = tuple(i for i in some if i not in independent)
        return dataclasses.replace(unknown, kind="redundant", follow=follow)
    dimension = second_order.dimension(part, row_rank, times)
    if dimension is not None:
        return dataclasses.replace(unknown, kind="deficient", codimension=len(part.coordinates) - dimension)
    found = manifold.codimensions(part, times)
    if len(found) == 1 and (codimension := found.pop()) is not None and codimension > row_rank:
        return dataclasses.replace(unknown, kind="singular", codimension=codimension)
    return unknown


def _joined(system: System, found: int, sets: list[Codimension], flat: set[int]) -> Codimension:
    """The answer for all sets; flat: rows whose gradients vanish."""
    kind = max((one.kind for one in sets), key=ORDER.index)
    rows = tuple(sorted({i for one in sets if one.kind == kind for i in one.rows}))
    coordinates = tuple(sorted({i for one in sets if one.kind == kind for i in one.coordinates}))
    follow = tuple(sorted({i for one in sets for i in one.follow}))
    notes = tuple(
        f"the rows {initial.names_of(system, one.rows)} take more freedoms than their gradients say: with the rows"
        f" around them {one.codimension} by second derivatives, {one.rank} by rank; the multiplier rule fails for them"
        for one in sets
        if one.kind == "deficient"
    )
    if kind == "undecided":
        alone, others = [i for i in rows if i in flat], [i for i in rows if i not in flat]
        sentences = []
        if alone:
            what = "the gradient of {} vanishes" if len(alone) == 1 else "the gradients of {} vanish"
            sentences.append(what.format(initial.names_of(system, alone)) + " at the start")
        if others:
            names = initial.names_of(system, others)
            sentences.append(f"the rows {names} depend on one another at the start")
        reason = (
            f"{', and '.join(sentences)}, and neither the rank nor second derivatives prove the dimension of the"
            " surface"
        )
        return Codimension(kind, found, None, rows, coordinates, follow, reason, notes)
    codimension = found + sum((one.codimension or 0) - one.rank for one in sets)
    return Codimension(kind, found, codimension, rows, coordinates, follow, "", notes)


def multiplier_rule(system: System, found: Codimension) -> diagnostics.ModelError:
    """The error of a run of rows that are `deficient`: no finite multipliers give the true motion."""
    rows = list(found.rows)
    message = (
        f"the multiplier rule fails for the rows {initial.names_of(system, rows)}: the constraints take"
        f" {found.codimension} freedoms, and their gradients span only {found.rank} directions wherever they hold, so"
        " that no finite multipliers give the true motion"
    )
    hint = "write the constraint so that its gradient does not vanish where it holds"
    names = system.model.coordinate_names
    held = [names[i] for i in sorted(set(system.rows.B[rows, :].sparsity().get_col()))]
    particles = list(dict.fromkeys(name.rpartition(".")[0] for name in held))
    if len(particles) > 1 and not any(name in system.model.generalized_names for name in held):
        most = initial.PARAMETERS.most_listed
        shown = ", ".join([f"`{name}`" for name in particles[:most]] + ["..."] * (len(particles) > most))
        hint = f"declare {shown} under `rigid` in place of these rows: the rows of a body are independent"
    location = system.rows.rows[rows[-1]].location
    return diagnostics.error("multiplier-rule-fails", message, location, hint)


def undecided_start(
    system: System, numeric: NumericSystem, state: State, surface: Codimension
) -> diagnostics.ModelError:
    """The error for a start at which the dimension of the surface is undecided."""
    rows = list(surface.rows)
    location = system.rows.rows[rows[-1]].location
    if len(rows) == 1:
        hint = "start where the gradient of this row does not vanish, or write the row so that it vanishes nowhere"
        return diagnostics.error("dependent-constraints", surface.reason, location, hint)
    # The rows that depend on the others at points beside the surface, where most are independent.
    random = np.random.default_rng(SEED)
    follow: list[int] = rows
    for _ in range(3):
        direction = random.standard_normal(state.q.size)
        there = dataclasses.replace(
            state, q=state.q + projection.PARAMETERS.offset * initial.size(state.q) * direction
        )
        if not projection.is_finite(numeric, there):
            continue
        B = numeric.rows(there.t, there.q, there.v, there.p)[0][rows, :]
        beside = MetricRows(B, initial.metric_at(numeric, there))
        chosen = independent_rows.dependence(beside, rank.estimate(beside).high)
        if len(chosen.rest) < len(follow):
            follow = [rows[i] for i in chosen.rest]
    hint = (
        "beside the start these rows are independent, so none of them can be left out: this is a singular"
        " configuration, where branches of the motion may meet; start at a configuration aside of it"
    )
    if follow:
        hint = (
            f"{initial.names_of(system, follow)} {'depends' if len(follow) == 1 else 'depend'} on the others beside the"
            " start too: leave out what follows from the others"
        )
    return diagnostics.error("dependent-constraints", surface.reason, location, hint)
