"""Points where the function has a kink, or a pole: there it may have an extreme that no lambda balances.

The shortest sum of distances to the corners of an obtuse triangle is that from the corner itself; |x - 1| + x^2/4 is
least at 1. Where u vanishes in sqrt(u), |u|, u^(1/3) or the difference u of min and max, the stationary points on the
surface u = 0 are candidates, with some inequalities closed; whether the function rises from one of them, or falls, its
slopes say on all sides that are open. Where a divisor vanishes, or what a logarithm is taken of, there is no value:
such a place is named, with what the function does beside it.
"""

from __future__ import annotations

import dataclasses
import itertools
from collections.abc import Callable, Iterator, Sequence
from typing import NamedTuple

import casadi as ca
import numpy as np
import numpy.typing as npt

from lagcli import doubles
from lagcli.linear import decompositions, rank
from lagcli.smoothness import operation_graph, switches
from lagcli.statics import (
    further_zeros,
    point_search,
    point_type,
    precise_zeros,
    refine,
    rest_equations,
    static_report,
)
from lagcli.statics.point_search import PointSearch
from lagcli.statics.rest_equations import RestEquations
from lagcli.statics.static_problem import StaticLaws, StaticProblem

Floats = npt.NDArray[np.float64]


class KinkSearchParameters:
    """Lengths are parts of the size of things. The tests are of `tests/unit/test_numbers_of_statics.py`."""

    __slots__ = ()

    most_kinks: int = 12
    """Of more kinks none is looked at, which a note says. `test_twelve_kinks_are_looked_at` fails at 1 and 120."""
    tries: int = 6
    """Starts at random, beside the start of the model. `test_kinks_are_sought_from_six_starts_beside_the_first`
    fails at 0."""
    beside: float = 1e-6
    """How far off a kink slopes are looked at, and the last of three distances from a pole, each a hundredth of the one
    before, at which values are compared. `test_slopes_are_looked_at_six_digits_off_a_kink` and
    `test_a_step_that_is_wide_is_no_pole` fail at 1e-7 and 1e-5."""
    same: float = 1e-5
    """Points closer than this are one: zeros of squares are found to the root of rounding.
    `test_kinks_closer_than_five_digits_are_one` fails at 1e-6 and 1e-4."""
    isolated: float = 1e-4
    """A kink whose gradient is this part of its size, or less, is one of a point alone, as that of a distance.
    `test_a_kink_without_a_gradient_is_one_of_a_point` fails at 1e-5 and 1e-3."""
    continuous: float = 0.9
    """Differences of values from that at a kink, a thousand times nearer, that are more than this part of them: it is
    a pole. `test_a_power_of_a_fiftieth_is_a_kink_and_one_of_a_five_hundredth_is_none` fails at 0.09 and 9."""
    unbounded: float = 0.5
    """Of the changes of the value from one of these distances to the next: a logarithm's are equal.
    `test_a_value_that_grows_less_and_less_is_bounded` fails at 0.05 and 5."""
    most_meeting: int = 64
    """Sets of kinks that may meet; of more a note says that none is looked at. At 6 and at 640
    `test_four_kinks_that_meet_are_looked_at_and_seven_are_not` of `tests/physics/test_tails_and_kinks.py` fails."""
    narrowings: int = 12
    """Times that the directions from which a function is seen to fall most are drawn half as far about the best one.
    At 1 `test_a_narrow_valley_between_kinks_is_seen` of `tests/physics/test_tails_and_kinks.py` fails."""


PARAMETERS = KinkSearchParameters()
_POLES = (ca.OP_DIV, ca.OP_INV, ca.OP_LOG)
# What is zero, or not, where the argument is: the argument of these stands for them.
_INNER = (ca.OP_SQRT, ca.OP_SQ, ca.OP_FABS, ca.OP_NEG, ca.OP_TWICE)


class Kink(NamedTuple):
    """A kink where `argument` (1, 1) is zero; number: of the operation that makes it, among those that make kinks, None
    of a pole; word: its name."""

    word: str
    argument: ca.SX
    number: int | None


class KinkPoint(NamedTuple):
    """An extreme at a kink."""

    word: str
    q: Floats
    kind: str


def kinks(laws: StaticLaws) -> list[Kink]:
    """The kinks and poles of the function, by its operations; none of those whose arguments do not vary."""
    found: list[Kink] = []
    numbers = itertools.count()
    for each in switches.among(ca.densify(laws.value), [laws.q, laws.t, laws.p]):
        word = "/" if each.kind.word == switches.QUOTIENT else each.kind.word
        kink, pole = _argument(each.op, each.parts), _divisor(each.op, each.parts)
        if kink is not None and ca.depends_on(kink, laws.q):
            found.append(Kink(word, kink, next(numbers)))
        if pole is not None and ca.depends_on(pole, laws.q):
            found.append(Kink(word, pole, None))
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


def _divisor(op: int, parts: Sequence[ca.SX]) -> ca.SX | None:
    """Return what is zero at the pole of an operation, as simple as it is; None where it has none."""
    if op in (ca.OP_POW, ca.OP_CONSTPOW):
        divisor = parts[0] if not parts[1].is_constant() or float(parts[1]) < 0 else None
    else:
        divisor = parts[-1] if op in _POLES else None
    while divisor is not None and any(divisor.is_op(inner) for inner in _INNER):
        divisor = divisor.dep(0)
    return divisor


def _on_kinks(laws: StaticLaws, there: Sequence[Kink]) -> StaticLaws:
    """The problem on the surface u = 0 of all of some kinks, or of a pole, of the function with the results of these
    kinks as they are there."""
    numbers, passed = {kink.number for kink in there}, itertools.count()

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
    return dataclasses.replace(
        laws,
        F=ca.densify(laws.driving - ca.gradient(value, laws.q)),
        B=ca.vertcat(laws.B, ca.jacobian(arguments, laws.q)),
        c=ca.densify(ca.vertcat(laws.c, arguments)),
        value=value,
    )


def extremes(search: PointSearch, known: Sequence[Kink]) -> Iterator[KinkPoint]:
    """Extremes at kinks, as far as they are found: on each alone, then where several meet."""
    problem = search.problem
    found: list[Floats] = []
    alone = [(kink,) for kink in known if kink.number is not None]
    for there in itertools.chain(alone, _meeting(problem, known) or ()):
        on_kink = StaticProblem(_on_kinks(problem.laws, there), problem.p, (problem.t, problem.begin), 0.0)
        for q in _candidates(search, on_kink):
            if any(search.apart(q, other) <= PARAMETERS.same for other in found):
                continue
            kind = _kind(search, on_kink, q)
            if kind is not None and precise_zeros.is_met(on_kink, q, search.scales.length):
                found.append(q)
                yield KinkPoint(there[0].word, q, kind)


def _meeting(problem: StaticProblem, known: Sequence[Kink]) -> list[tuple[Kink, ...]] | None:
    """Sets of kinks that may meet, in a point or along a surface; None where they are too many."""
    makers = [kink for kink in known if kink.number is not None]
    most = min(len(makers), problem.n - problem.laws.c.numel())
    sets = itertools.chain.from_iterable(itertools.combinations(makers, size) for size in range(2, most + 1))
    found = list(itertools.islice(sets, PARAMETERS.most_meeting + 1))
    return found if len(found) <= PARAMETERS.most_meeting else None


def _candidates(search: PointSearch, on_kink: StaticProblem) -> Iterator[Floats]:
    """Stationary points on the surface of a kink, with each set of contacts closed: points on it where its gradient
    vanishes, as that of a distance does, and points in balance."""
    problem, length = search.problem, search.scales.length
    scales = rest_equations.scales(on_kink, problem.begin)
    begins = [problem.begin, *search.others(PARAMETERS.tries)]
    for size in range(problem.K + 1):
        for closed in itertools.combinations(range(problem.K), size):
            for begin in begins:
                q = further_zeros.onto(on_kink, begin, closed, scales)
                if q is None:
                    continue
                values = on_kink.at(on_kink.t, q, on_kink.nothing)
                row, count = values.dc[-1], on_kink.laws.c.numel() + size
                if np.linalg.norm(row) > PARAMETERS.isolated * scales.conditions[-1] and problem.n > count:
                    point = refine.reached(on_kink, q, closed, scales)
                    if not isinstance(point, refine.EquilibriumPoint):
                        continue
                    q = point.q
                q = np.where(np.abs(q) <= doubles.ZERO * length, 0.0, q)
                g = on_kink.at(on_kink.t, q, on_kink.nothing).g
                if (g >= -doubles.ZERO * search.scales.contacts * length).all():
                    yield q


def _kind(search: PointSearch, on_kink: StaticProblem, q: Floats) -> str | None:
    """`minimum` or `maximum` at a kink, by the slopes beside it on all sides that are open; None where it is none, or
    undecided."""
    problem, h = search.problem, PARAMETERS.beside * search.scales.length
    here = problem.value(q)
    if not np.isfinite([here, on_kink.value(q)]).all():
        return None  # 1/sqrt(x**2 + y**2) has a pole there
    values = on_kink.at(on_kink.t, q, on_kink.nothing)
    near = values.g <= doubles.ZERO * search.scales.contacts * search.scales.length
    rows = len(problem.laws.c.nz)
    Z = rank.null_basis(decompositions.unit(values.dc[:rows]))
    normals = values.dc[rows:] @ Z
    sizes, least = np.linalg.norm(normals, axis=1), PARAMETERS.isolated
    is_surface = bool((sizes > least * np.maximum(1.0, np.linalg.norm(values.dc[rows:], axis=1))).all())
    along, steepest = "isolated", np.linalg.norm(values.G[near], axis=1)[:, None]
    walls = values.G[near] @ Z
    bounds = decompositions.unit(np.vstack([normals, walls]))
    if is_surface and rank.null_basis(bounds).size:
        # The type of the point on the surface, with these contacts closed
        scales = rest_equations.scales(on_kink, q)
        equations = RestEquations(on_kink, tuple(np.flatnonzero(near).tolist()), scales)
        x = refine.begun(equations, q)
        point = None if x is None else refine.settled(equations, x)
        along = ""
        if isinstance(point, refine.EquilibriumPoint):
            along = str(point_type.classify(on_kink, point, scales, True)[0].kind)

    def changes(ways: Floats, distance: float = h) -> Floats:
        """f - f(q) at a distance along directions (m, n) and at a thousandth of it, (2, m); nan beyond a contact and
        beyond the domain of a root."""
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
    if not beside.size or np.abs(beside[1]).max() > PARAMETERS.continuous * np.abs(beside[0]).max():
        return None
    slopes = beside[0] / h
    if not is_surface:
        farther = float(np.sqrt(h * search.scales.length))
        staying = _staying(on_kink, q, rows, Z, farther)
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


def _staying(on_kink: StaticProblem, q: Floats, rows: int, Z: Floats, distance: float) -> Floats:
    """Directions (d, k) of a space Z (n, d) in which arguments of kinks, after the first rows, stay zero although their
    gradients vanish, as the square of a distance does where both ends move: those that are drawn hardly meet them.

    distance: over which gradients are compared.
    """

    def gradients(at: Floats) -> Floats:
        return on_kink.at(on_kink.t, at, on_kink.nothing).dc[rows:] @ Z

    ends = [(gradients(q + distance * way) - gradients(q - distance * way)).ravel() for way in Z.T]
    changing = np.vstack([gradients(q), np.array(ends).T])
    size = float(np.abs(changing).max(initial=0.0))
    return rank.null_basis(changing / size) if size > 0 else np.eye(Z.shape[1])


def _widest(changes: Callable[[Floats], Floats], Z: Floats) -> Floats:
    """Changes of a function in directions of a space (n, k), with those in which it falls and rises most: where
    surfaces meet it may fall between two of them alone."""
    drawn = np.vstack([_drawn(Z), -_drawn(Z)])
    found = [changes(drawn)]
    for sign in (1.0, -1.0):
        ways, width = drawn, 1.0
        slopes = sign * found[0][0]
        for _ in range(PARAMETERS.narrowings if np.isfinite(slopes).any() else 0):
            width /= 2
            best = ways[np.nanargmin(slopes)]
            ways = best + width * drawn
            ways = np.vstack([best, ways / np.linalg.norm(ways, axis=1, keepdims=True)])
            found.append(changes(ways))
            slopes = sign * found[-1][0]
    return np.hstack(found)


def _drawn(Z: Floats) -> Floats:
    """Directions (8 k, n) of length one of a space (n, k)."""
    drawn = np.random.default_rng(5).standard_normal((8 * Z.shape[1], Z.shape[1]))
    return np.asarray((drawn / np.linalg.norm(drawn, axis=1, keepdims=True)) @ Z.T)


def pole_sentences(search: PointSearch, known: Sequence[Kink], names: Sequence[str], value: str) -> list[str]:
    """Sentences on places where the function has no value, one for each operation that makes them."""
    problem, length = search.problem, search.scales.length
    sentences, found = [], list[Floats]()
    for pole in known:
        if pole.number is not None:
            continue
        on_pole = StaticProblem(_on_kinks(problem.laws, (pole,)), problem.p, (problem.t, problem.begin), 0.0)
        scales = rest_equations.scales(on_pole, problem.begin)
        for begin in [problem.begin, *search.others(PARAMETERS.tries)]:
            q = further_zeros.onto(on_pole, begin, (), scales)
            if q is None:
                continue
            g = on_pole.at(on_pole.t, q, on_pole.nothing).g
            if (g < -doubles.ZERO * search.scales.contacts * length).any():
                continue
            q = np.where(np.abs(q) <= PARAMETERS.same * length, 0.0, q)
            if not any(search.apart(q, other) <= PARAMETERS.same for other in found):
                found.append(q)
                where, what = static_report.place(names, q), _beside(search, on_pole, q, value)
                sentences.append(f"at {where} the {value} is not defined, by `{pole.word}`: {what}")
            break
    return sentences[: point_search.PARAMETERS.most_named]


def _beside(search: PointSearch, on_pole: StaticProblem, q: Floats, value: str) -> str:
    """A sentence on the function beside a place where it has no value."""
    problem, length = search.problem, search.scales.length
    ways = _drawn(rank.null_basis(decompositions.unit(on_pole.at(on_pole.t, q, on_pole.nothing).dc[:-1])))
    ways = np.vstack([ways, -ways])
    far, middle, near = (
        np.array(
            [precise_zeros.value(problem, q + PARAMETERS.beside ** (k / 3) * length * way) for way in ways]
        )
        for k in (1, 2, 3)
    )
    first, then = middle - far, near - middle
    is_known = np.isfinite(then) & np.isfinite(first)
    least = np.maximum(PARAMETERS.unbounded * np.abs(first), doubles.ROOT * np.abs(near))
    wild = is_known & (np.abs(then) > least)
    rises, falls = bool((wild & (then > 0)).any()), bool((wild & (then < 0)).any())
    if rises and falls:
        return f"beside it the {value} grows and falls without bound"
    if rises or falls:
        return f"beside it the {value} {'grows' if rises else 'falls'} without bound"
    if not is_known.any():
        return "an extreme may sit there"
    return f"an extreme may sit there, where the {value} beside it is {near[is_known].mean():.6g}"


def notes(search: PointSearch, names: Sequence[str], value: str) -> list[str]:
    """Sentences on extremes at kinks and poles; `value`: the function that is asked for. Points of another type that
    the search has listed there are none."""
    problem, laws, most = search.problem, search.problem.laws, point_search.PARAMETERS.most_named
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
    why = _beyond(problem, known)
    if why:
        words = ", ".join(f"`{word}`" for word in dict.fromkeys(kink.word for kink in known))
        return [*sentences, f"{words} may have kinks or poles: extremes there have no lambda, and {why}"]
    sentences += pole_sentences(search, known, names, value)
    if _meeting(problem, known) is None:
        sentences.append("where several kinks meet extremes are not looked for")
    named = list(itertools.islice(extremes(search, known), most + 1))
    for point in named[:most]:
        # There derivatives are those of sign(0) = 0 and tell nothing.
        search.points = [
            known
            for known in search.points
            if known.type.kind == point.kind or search.apart(known.point.q, point.q) > PARAMETERS.same
        ]
        sentences.append(
            f"at {static_report.place(names, point.q)} `{point.word}` makes a kink, and no lambda is needed for the"
            f" {point.kind} of the {value} there ({value} = {problem.value(point.q):.9g})"
        )
    if len(named) > most:
        sentences.append("there are extremes at further kinks, which are not named")
    return sentences


def _beyond(problem: StaticProblem, known: Sequence[Kink]) -> str | None:
    """The reason that kinks are not looked at; None where they are."""
    if len(problem.times) > 1:
        return "are not looked for where equations hold t"
    limits = point_search.PARAMETERS
    if limits.most_contacts < problem.K:
        return "are not looked for among so many inequalities"
    is_large = len(known) > PARAMETERS.most_kinks or problem.n > limits.most_coordinates
    return "are not looked for" if is_large else None
