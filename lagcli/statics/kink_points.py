"""Points where an extreme may need no lambda: where the function has a kink or a pole, or rows depend on each other.

|x - 1| + x^2/4 is least at 1. Candidates are the stationary points on the surface u = 0 of sqrt(u), |u|, u^(1/3) or the
difference u of min and max, with some inequalities closed; slopes on all sides that are open tell the type. Where a
divisor vanishes, or what a logarithm is taken of, the place is named, with what the function does beside it.
"""

from __future__ import annotations

import dataclasses
import itertools
from collections.abc import Callable, Iterator, Sequence
from typing import NamedTuple

import casadi as ca
import numpy as np

from lagcli import doubles
from lagcli.arrays import Floats
from lagcli.linear import decompositions, rank
from lagcli.smoothness import operation_graph, switches
from lagcli.statics import (
    flat_directions,
    point_search,
    point_type,
    precise_zeros,
    refine,
    rest_equations,
    static_report,
)
from lagcli.statics.point_search import PointSearch
from lagcli.statics.rest_equations import SETTLED, RestEquations
from lagcli.statics.static_problem import StaticLaws, StaticProblem

# Differences of values from that at a kink, a thousand times nearer, that are more than this part: it is a pole.
CONTINUOUS = 1 - flat_directions.PARAMETERS.kept
# A kink whose gradient is this part of its size, or less, is one of a point alone, as that of a distance. Zeros of
# dependent gradients are double: coordinates of this part of the size of things are zero, closer points are one.
ISOLATED = point_search.PARAMETERS.same_of_flat
_POLES = (ca.OP_DIV, ca.OP_INV, ca.OP_LOG)
# What is zero, or not, where the argument is: the argument of these stands for them.
_INNER = (ca.OP_SQRT, ca.OP_SQ, ca.OP_FABS, ca.OP_NEG, ca.OP_TWICE)


class Kink(NamedTuple):
    """A kink where `argument` is zero; number: of its operation among those that make kinks, None of a pole."""

    word: str
    argument: ca.SX
    number: int | None


def kinks(laws: StaticLaws) -> list[Kink]:
    """The kinks and poles of the function, by its operations; none of those whose arguments do not vary."""
    found: list[Kink] = []
    numbers = itertools.count()
    for each in switches.among(ca.densify(laws.value), [laws.q, laws.t, laws.p]):
        word = "/" if each.kind.word == switches.QUOTIENT else each.kind.word
        kink = _argument(each.op, each.parts)
        if kink is not None and ca.depends_on(kink, laws.q):
            found.append(Kink(word, kink, next(numbers)))
        # What is zero at a pole, as simple as it is
        is_power = each.op in (ca.OP_POW, ca.OP_CONSTPOW)
        is_pole = each.op in _POLES
        if is_power:
            is_pole = not each.parts[1].is_constant() or float(each.parts[1]) < 0
        if not is_pole:
            continue
        divisor = each.parts[0 if is_power else -1]
        while any(divisor.is_op(inner) for inner in _INNER):
            divisor = divisor.dep(0)
        if ca.depends_on(divisor, laws.q):
            found.append(Kink(word, divisor, None))
    return found


def _argument(op: int, parts: Sequence[ca.SX]) -> ca.SX | None:
    """Return what is zero at the kink of an operation; None where it has none."""
    if op in (ca.OP_FABS, ca.OP_SQRT):
        return parts[0]
    if op in (ca.OP_FMIN, ca.OP_FMAX):
        return parts[0] - parts[1]
    if op in (ca.OP_ASIN, ca.OP_ACOS):
        return 1 - parts[0] ** 2
    if op in (ca.OP_POW, ca.OP_CONSTPOW) and parts[1].is_constant():
        power = float(parts[1])
        return parts[0] if 0 < power != round(power) else None
    return None


def on_kinks(problem: StaticProblem, there: Sequence[Kink]) -> StaticProblem:
    """The problem on u = 0 of some kinks, or of a pole, with their results as they are there."""
    laws, numbers, passed = problem.laws, {kink.number for kink in there}, itertools.count()

    def put(op: int, parts: list[ca.SX], result: ca.SX) -> ca.SX:
        argument = _argument(op, parts)
        if argument is None or not ca.depends_on(argument, laws.q) or next(passed) not in numbers:
            return result
        if op == ca.OP_ASIN:
            return np.pi / 2 * ca.sign(parts[0])
        if op == ca.OP_ACOS:
            return np.pi / 2 * (1 - ca.sign(parts[0]))
        return parts[0] if op in (ca.OP_FMIN, ca.OP_FMAX) else ca.SX(0)

    value = operation_graph.replayed(ca.densify(laws.value), [laws.q, laws.t, laws.p], put)
    arguments = ca.vertcat(*(kink.argument for kink in there))
    on_surface = dataclasses.replace(
        laws,
        F=ca.densify(laws.driving - ca.gradient(value, laws.q)),
        B=ca.vertcat(laws.B, ca.jacobian(arguments, laws.q)),
        c=ca.densify(ca.vertcat(laws.c, arguments)),
        value=value,
    )
    return StaticProblem(on_surface, problem.p, (problem.t, problem.begin), 0.0)


def extremes(search: PointSearch, sets: Sequence[tuple[Kink, ...]]) -> Iterator[tuple[str, Floats, str]]:
    """Extremes where sets of kinks meet, as far as they are found: the word of a kink, the place and the type.

    Candidates are, with each set of contacts closed, points where the gradient of the surface of a kink vanishes, as
    that of a distance does, and points in balance on it.
    """
    problem, touch, found = search.problem, search.scales.touch, list[Floats]()
    for there in sets:
        on_kink = on_kinks(problem, there)
        free = RestEquations(on_kink, (), rest_equations.scales(on_kink, problem.begin))
        for closed, begin in itertools.product(problem.contact_sets(), [problem.begin, *search.others(6)]):
            equations = free.closing(closed)
            q = refine.onto(equations, begin)
            if q is None:
                continue
            row = on_kink.at(on_kink.t, q, on_kink.nothing).dc[-1]
            is_surface = np.linalg.norm(row) > ISOLATED * free.scales.conditions[-1]
            if is_surface and problem.n > on_kink.laws.c.numel() + len(closed):
                point = refine.reached(equations, q)
                if not point.rests:
                    continue
                q = point.q
            q = np.where(np.abs(q) <= doubles.ZERO * search.scales.length, 0.0, q)
            if not (on_kink.at(on_kink.t, q, on_kink.nothing).g >= -touch).all():
                continue
            if any(search.apart(q, other) <= SETTLED for other in found):
                continue
            kind = kind_at(search, on_kink, q)
            if kind is not None and precise_zeros.is_met(on_kink, q, search.scales.length):
                found.append(q)
                yield there[0].word, q, kind


def kind_at(search: PointSearch, on_kink: StaticProblem, q: Floats) -> str | None:
    """`minimum` or `maximum` at a kink, by the slopes on all open sides; None where it is none or undecided."""
    problem, h = search.problem, doubles.ROOT * search.scales.length
    here = problem.value(q)
    if not np.isfinite([here, on_kink.value(q)]).all():
        return None  # 1/sqrt(x**2 + y**2) has a pole there
    values = on_kink.at(on_kink.t, q, on_kink.nothing)
    near = values.g <= search.scales.touch
    rows = len(problem.laws.c.nz)
    Z = rank.null_basis(decompositions.unit(values.dc[:rows]))
    normals = values.dc[rows:] @ Z
    sizes = np.linalg.norm(normals, axis=1)
    is_surface = bool((sizes > ISOLATED * np.maximum(1.0, np.linalg.norm(values.dc[rows:], axis=1))).all())
    along, steepest = "isolated", np.linalg.norm(values.G[near], axis=1)[:, None]
    walls = values.G[near] @ Z
    bounds = decompositions.unit(np.vstack([normals, walls]))
    if is_surface and rank.null_basis(bounds).size:
        # The type of the point on the surface, with these contacts closed
        scales = rest_equations.scales(on_kink, q)
        equations = RestEquations(on_kink, tuple(np.flatnonzero(near).tolist()), scales)
        x = equations.begun(q)
        point = None if x is None else equations.settled(x)
        along = ""
        if point is not None and point.rests:
            along = str(point_type.classify(equations, point, True)[0].kind)

    def changes(ways: Floats, distance: float = h) -> Floats:
        """f - f(q) at a distance along directions (m, n) and at a thousandth of it, (2, m); nan where there is none."""
        found = np.full((2, len(ways)), np.nan)
        for k in np.flatnonzero((values.G[near] @ ways.T >= -doubles.VALUE * steepest).all(axis=0)):
            both = [problem.value(q + part * distance * ways[k]) - here for part in (1.0, 1e-3)]
            found[:, k] = both if np.isfinite(both).all() else np.nan
        return found

    if is_surface and len(normals) == 1 and not near.any():
        way = normals @ Z.T / sizes
        beside = changes(np.vstack([way, -way]))
    else:
        beside = _widest(changes, Z)
    beside = beside[:, np.isfinite(beside[0])]
    if not beside.size or np.abs(beside[1]).max() > CONTINUOUS * np.abs(beside[0]).max():
        return None
    slopes = beside[0] / h
    if not is_surface:
        # Directions in which arguments of kinks stay zero although their gradients vanish there, as these stay the same
        # over a distance: those that are drawn hardly meet them.
        farther = float(np.sqrt(h * search.scales.length))
        places = [q, *(q + sign * farther * way for way in Z.T for sign in (1, -1))]
        first, *ends = (on_kink.at(on_kink.t, at, on_kink.nothing).dc[rows:] @ Z for at in places)
        turning = [(end - other).ravel() for end, other in zip(ends[::2], ends[1::2], strict=True)]
        changing = np.vstack([first, np.array(turning).T])
        size = float(np.abs(changing).max(initial=0.0))
        staying = rank.null_basis(changing / size) if size > 0 else np.eye(Z.shape[1])
        # Along contacts, too: of others one side alone is allowed.
        level = rank.null_basis(decompositions.unit(walls @ staying))
        staying = (Z @ np.hstack([staying, staying @ level])).T
        along_kinks = changes(np.vstack([staying, -staying]), farther)[0] / farther
        slopes = np.append(slopes, along_kinks[np.isfinite(along_kinks)])
    floor = doubles.ROOT * max(float(np.abs(slopes).max()), search.scales.force)
    if (slopes > floor).all() and along in ("isolated", "minimum"):
        return "minimum"
    if (slopes < -floor).all() and along in ("isolated", "maximum"):
        return "maximum"
    return None


def _widest(changes: Callable[[Floats], Floats], Z: Floats) -> Floats:
    """Changes of a function in directions of a space (n, k), with those in which it falls and rises most, drawn half as
    far about the best one again and again: where surfaces meet it may fall between two of them alone."""
    drawn = _drawn(Z)
    found = [changes(drawn)]
    for sign in (1.0, -1.0):
        ways, width, slopes = drawn, 1.0, sign * found[0][0]
        for _ in range(12 if np.isfinite(slopes).any() else 0):
            width /= 2
            best = ways[np.nanargmin(slopes)]
            ways = best + width * drawn
            ways = np.vstack([best, ways / np.linalg.norm(ways, axis=1, keepdims=True)])
            found.append(changes(ways))
            slopes = sign * found[-1][0]
    return np.hstack(found)


def _drawn(Z: Floats) -> Floats:
    """Directions (16 k, n) of length one of a space (n, k), in pairs of opposite ones."""
    drawn = np.random.default_rng(5).standard_normal((8 * Z.shape[1], Z.shape[1]))
    ways = (drawn / np.linalg.norm(drawn, axis=1, keepdims=True)) @ Z.T
    return np.vstack([ways, -ways])


def pole_sentences(search: PointSearch, known: Sequence[Kink], names: Sequence[str], value: str) -> list[str]:
    """Sentences on places where the function has no value, one for each operation that makes them."""
    problem = search.problem
    sentences, found = [], list[Floats]()
    for pole in known:
        if pole.number is not None:
            continue
        on_pole = on_kinks(problem, (pole,))
        free = RestEquations(on_pole, (), rest_equations.scales(on_pole, problem.begin))
        for begin in [problem.begin, *search.others(6)]:
            q = refine.onto(free, begin)
            if q is None or (on_pole.at(on_pole.t, q, on_pole.nothing).g < -search.scales.touch).any():
                continue
            q = np.where(np.abs(q) <= SETTLED * search.scales.length, 0.0, q)
            if not any(search.apart(q, other) <= SETTLED for other in found):
                found.append(q)
                where, what = static_report.place(names, q), _beside(search, on_pole, q, value)
                sentences.append(f"at {where} the {value} is not defined, by `{pole.word}`: {what}")
            break
    return sentences[: point_search.PARAMETERS.most_named]


def _beside(search: PointSearch, on_pole: StaticProblem, q: Floats, value: str) -> str:
    """What the function does beside a pole, by values at three distances: of a logarithm they change by the same."""
    rows = on_pole.at(on_pole.t, q, on_pole.nothing).dc[:-1]
    ways = _drawn(rank.null_basis(decompositions.unit(rows)))
    far, middle, near = (
        np.array([precise_zeros.value(search.problem, q + distance * way) for way in ways])
        for distance in doubles.ROOT ** (np.arange(1, 4) / 3) * search.scales.length
    )
    first, then = middle - far, near - middle
    is_known = np.isfinite(then) & np.isfinite(first)
    wild = is_known & (np.abs(then) > np.maximum(np.abs(first) / 2, doubles.ROOT * np.abs(near)))
    turns = [word for word, sign in (("grows", 1), ("falls", -1)) if (wild & (sign * then > 0)).any()]
    if turns:
        return f"beside it the {value} {' and '.join(turns)} without bound"
    if not is_known.any():
        return "an extreme may sit there"
    return f"an extreme may sit there, where the {value} beside it is {near[is_known].mean():.6g}"


def notes(search: PointSearch, names: Sequence[str], value: str) -> list[str]:
    """Sentences on extremes at kinks and poles; points of another type that the search has there are taken out."""
    problem, laws, limits = search.problem, search.problem.laws, point_search.PARAMETERS
    jumps = [
        f"`{each.kind.word}`"
        for each in switches.among(laws.driving, [laws.q, laws.t, laws.p])
        if each.kind.is_comparing and each.kind.word and ca.depends_on(each.value, laws.q)
    ]
    sentences = []
    if jumps:
        words = ", ".join(dict.fromkeys(jumps))
        sentences.append(f"{words} make forces jump: points of rest at a jump are not looked for")
    known = kinks(laws) if search.options.has_potential else []
    if not known:
        return sentences
    why = ""
    if len(problem.times) > 1:
        why = " where equations hold t"
    elif limits.most_contacts < problem.K:
        why = " among so many inequalities"
    if why or len(known) > 12 or problem.n > limits.most_coordinates:
        words = ", ".join(f"`{word}`" for word in dict.fromkeys(kink.word for kink in known))
        told = f"{words} may have kinks or poles: extremes there have no lambda, and are not looked for{why}"
        return [*sentences, told]
    sentences += pole_sentences(search, known, names, value)
    # Each kink alone, then those that may meet, in a point or along a surface
    makers = [kink for kink in known if kink.number is not None]
    most = min(len(makers), problem.n - problem.laws.c.numel())
    sets = itertools.chain.from_iterable(itertools.combinations(makers, size) for size in range(2, most + 1))
    meeting = list(itertools.islice(sets, 65))
    if len(meeting) > 64:
        sentences.append("where several kinks meet extremes are not looked for")
        meeting = []
    alone = [(kink,) for kink in makers]
    named = list(itertools.islice(extremes(search, [*alone, *meeting]), limits.most_named + 1))
    for word, q, kind in named[: limits.most_named]:
        # There derivatives are those of sign(0) = 0 and tell nothing.
        search.points = [
            known
            for known in search.points
            if known.type.kind == kind or search.apart(known.point.q, q) > SETTLED
        ]
        sentences.append(
            f"at {static_report.place(names, q)} `{word}` makes a kink, and no lambda is needed for the"
            f" {kind} of the {value} there ({value} = {problem.value(q):.9g})"
        )
    if len(named) > limits.most_named:
        sentences.append("there are extremes at further kinks, which are not named")
    return sentences


# Where gradients depend on each other


def singular_notes(search: PointSearch, names: Sequence[str], value: str) -> list[str]:
    """Sentences on points where gradients depend on each other, and the multiplier rule need not hold.

    min x on x^3 = y^2; with contacts max x on 0 <= y <= (1 - x)^3 (Kuhn and Tucker), where multipliers of one sign
    balance each other. `value`: the function that is asked for.
    """
    problem, limits = search.problem, point_search.PARAMETERS
    if problem.n > limits.most_coordinates or len(problem.times) > 1:
        return []
    places: list[tuple[Floats, str]] = []
    for closed in problem.contact_sets() if limits.most_contacts >= problem.K else [()]:
        which = "closed inequalities" if closed else "the rows"
        for q in _singular(search, closed) if problem.C or closed else ():
            if not any(search.apart(q, other) <= 10 * ISOLATED for other, _ in places):
                places.append((q, which))
    told = [
        f"at {static_report.place(names, q)} the gradients of {which} depend on each other: the multiplier"
        " rule need not hold there, and it may be an extreme without lambda"
        f" ({value} = {problem.value(q):.9g})"
        for q, which in places[: limits.most_named]
    ]
    return told + ["there are more such points"] * (len(places) > limits.most_named)


def _singular(search: PointSearch, closed: tuple[int, ...]) -> Iterator[Floats]:
    """Configurations where rows and these closed contacts, independent elsewhere, depend on each other."""
    problem, scales = search.problem, search.scales
    random = np.random.default_rng(search.options.seed + 1)
    # Rows that are independent at a point anywhere; none where contacts are not independent of them
    anywhere = problem.begin + 0.3 * scales.length * random.standard_normal(problem.n)
    values = problem.at(problem.t, anywhere, problem.nothing)
    B, G = values.B, values.G[list(closed)]
    rows: list[int] = []
    for row in range(problem.C):
        if np.isfinite(B[row]).all() and point_type.unit_rank(B[[*rows, row]]) > len(rows):
            rows.append(row)
    together = np.vstack([B[rows], G])
    if closed and (not np.isfinite(G).all() or point_type.unit_rank(together) < len(together)):
        return
    chosen = [*rows, *(problem.C + k for k in closed)]
    gradients = problem.at(problem.t, problem.begin, problem.nothing).rows(range(problem.K))[chosen]
    lengths = np.maximum(np.linalg.norm(np.nan_to_num(gradients), axis=1), rest_equations.SMALL)
    contacts = list(closed)
    size = np.concatenate([scales.conditions, scales.contacts[contacts]])

    def dependent(x: Floats) -> tuple[Floats, Floats] | None:
        """c = 0, g = 0, B^T mu = 0, |mu| = 1 of (q, mu)."""
        q, mu = x[: problem.n], x[problem.n :]
        lam = problem.nothing
        lam[chosen] = mu / lengths
        with_mu, without = (problem.at(problem.t, q, each) for each in (lam, problem.nothing))
        G, g = with_mu.G[contacts], with_mu.g[contacts]
        if not with_mu.finite or not without.finite or not np.isfinite(G).all() or not np.isfinite(g).all():
            return None
        unit = with_mu.rows(range(problem.K))[chosen] / lengths[:, None]
        on = np.concatenate([with_mu.c, g]) / size
        slopes = np.vstack([with_mu.dc, G]) / size[:, None]
        by_q = np.vstack([slopes, with_mu.K - without.K, np.zeros((1, problem.n))])
        by_mu = np.vstack([np.zeros((on.size, mu.size)), unit.T, 2 * mu[None]])
        return np.concatenate([on, unit.T @ mu, [mu @ mu - 1]]), np.hstack([by_q, by_mu])

    begins = [problem.begin, *(one.point.q for one in search.points if not one.type.unique)]
    conditions = problem.laws.c.numel() + len(closed)
    for begin in [*begins, *search.others(4 if closed else 12)]:
        mu = random.standard_normal(lengths.size)
        x = np.concatenate([begin, mu / np.linalg.norm(mu)])
        # Constant gradients that are independent somewhere are so everywhere.
        here = dependent(x) if closed else None
        if here is not None and not here[1][conditions:-1, : problem.n].any():
            return
        end = refine.solve(dependent, x, 80)
        if end is None or not end.distance <= 100 * doubles.VALUE or not np.isfinite(end.x).all():
            continue
        pushes = end.x[problem.n + len(rows) :]
        if closed and not ((pushes > ISOLATED).all() or (pushes < -ISOLATED).all()):
            continue  # contacts of both signs leave a side free, on which the rule holds
        # The digits that are no rounding: three where rows hold there to rounding, or zero what is nearly so
        q = end.x[: problem.n]
        zeroed = np.where(np.abs(q) <= ISOLATED * scales.length, 0.0, q)
        for tried in (np.round(q / scales.length, 3) * scales.length, zeroed):
            again = dependent(np.concatenate([tried, end.x[problem.n :]]))
            if again is None or np.linalg.norm(again[0]) > ISOLATED:
                continue
            if tried is zeroed or np.abs(again[0][:conditions]).max(initial=0.0) <= 4 * doubles.EPS:
                q = tried + 0.0
                break
        g = problem.at(problem.t, q, problem.nothing).g / scales.contacts
        if not (g < -ISOLATED * scales.length).any():
            yield q
