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
from lagcli.statics import newton, point_type, precise_zeros, refine, rest_equations, surface_descent
from lagcli.statics.point_search import PointSearch
from lagcli.statics.rest_equations import RestEquations
from lagcli.statics.static_laws import StaticLaws
from lagcli.statics.static_problem import StaticProblem

Floats = npt.NDArray[np.float64]


class KinkSearchParameters:
    """Numbers of the search for extremes at kinks; lengths are parts of the size of things.

    The tests are of `tests/unit/test_numbers_of_statics.py`.
    """

    __slots__ = ()

    most_kinks: int = 12
    """Of more kinks none is looked at, which a note says. `test_twelve_kinks_are_looked_at` fails at 1 and 120."""
    most_coordinates: int = 12
    """Of more coordinates neither: starts at random find none in so many dimensions.
    `test_kinks_are_looked_at_among_twelve_coordinates` fails at 1 and 120."""
    tries: int = 6
    """Starts at random, beside the start of the model. `test_kinks_are_sought_from_six_starts_beside_the_first`
    fails at 0."""
    beside: float = 1e-6
    """How far off a kink slopes are looked at: `test_slopes_are_looked_at_six_digits_off_a_kink` fails at 1e-7 and
    1e-5."""
    same: float = 1e-5
    """Points closer than this are one: zeros of squares are found to the root of rounding.
    `test_kinks_closer_than_five_digits_are_one` fails at 1e-6 and 1e-4."""
    isolated: float = 1e-4
    """A kink whose gradient is this part of its size, or less, is one of a point alone, as that of a distance.
    `test_a_kink_without_a_gradient_is_one_of_a_point` fails at 1e-5 and 1e-3."""
    continuous: float = 0.9
    """Differences of values from that at a kink, a thousand times nearer, that are more than this part of them: it is
    a pole. `test_a_power_of_a_fiftieth_is_a_kink_and_one_of_a_five_hundredth_is_none` fails at 0.09 and 9."""
    around: tuple[float, ...] = (1e-2, 1e-4, 1e-6)
    """Distances from a pole at which values are compared. `test_a_step_that_is_wide_is_no_pole` fails at a tenth and
    at ten times of it."""
    unbounded: float = 0.5
    """Of the changes of the value from one of these distances to the next: a logarithm's are equal.
    `test_a_value_that_grows_less_and_less_is_bounded` fails at 0.05 and 5."""
    most_meeting: int = 64
    """Sets of kinks that may meet; of more a note says that none is looked at. At 6 and at 640
    `test_four_kinks_that_meet_are_looked_at_and_seven_are_not` of `tests/physics/test_tails_and_kinks.py` fails."""
    narrowings: int = 12
    """Times that the directions from which a function is seen to fall most are drawn half as far about the best one.
    At 1 `test_a_narrow_valley_between_kinks_is_seen` of `tests/physics/test_tails_and_kinks.py` fails."""
    most_contacts: int = 3
    """Inequalities, every set of which is closed in turn; of more a note says that none is.
    `test_kinks_are_looked_at_among_three_contacts` fails at 0 and 30."""
    most_named: int = 4
    """Points that notes name; `test_notes_name_four_kinks` fails at 0 and 40."""


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
    inputs, value = [laws.q, laws.t, laws.p], ca.densify(laws.value)
    found = [
        (each.op, argument, is_pole)
        for each in switches.among(value, inputs)
        for argument, is_pole in (
            (_argument(each.op, each.parts), False),
            (_divisor(each.op, each.parts), True),
        )
        if argument is not None and ca.depends_on(argument, laws.q)
    ]
    numbers = itertools.count()
    return [Kink(_word(op), argument, None if is_pole else next(numbers)) for op, argument, is_pole in found]


def _word(op: int) -> str:
    word = switches.KINDS[op].word
    return "/" if word == switches.QUOTIENT else word


def _with_kinks(laws: StaticLaws, numbers: set[int | None]) -> ca.SX:
    """The function with the results of some of its kinks as they are at the kinks."""
    passed = 0

    def put(op: int, parts: list[ca.SX], result: ca.SX) -> ca.SX:
        nonlocal passed
        argument = _argument(op, parts)
        if argument is None or not ca.depends_on(argument, laws.q):
            return result
        passed += 1
        if passed - 1 not in numbers:
            return result
        if op == ca.OP_ASIN:
            return np.pi / 2 * ca.sign(parts[0])
        if op == ca.OP_ACOS:
            return np.pi / 2 * (1 - ca.sign(parts[0]))
        return parts[0] if op in (ca.OP_FMIN, ca.OP_FMAX) else ca.SX(0)

    return operation_graph.replayed(ca.densify(laws.value), [laws.q, laws.t, laws.p], put)


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
    """The problem on the surface u = 0 of all of some kinks, or of a pole."""
    value = _with_kinks(laws, {kink.number for kink in there})
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
    for there in itertools.chain(_alone(known), _meeting(problem, known) or ()):
        on_kink = StaticProblem(_on_kinks(problem.laws, there), problem.p, (problem.t, problem.begin), 0.0)
        for q in _candidates(search, on_kink):
            if any(search.apart(q, other) <= PARAMETERS.same for other in found):
                continue
            kind = _kind(search, on_kink, q)
            if kind is not None and precise_zeros.is_met(on_kink, q, search.scales.length):
                found.append(q)
                yield KinkPoint(there[0].word, q, kind)


def _alone(known: Sequence[Kink]) -> list[tuple[Kink, ...]]:
    return [(kink,) for kink in known if kink.number is not None]


def _meeting(problem: StaticProblem, known: Sequence[Kink]) -> list[tuple[Kink, ...]] | None:
    """Sets of kinks that may meet, in a point or along a surface; None where they are too many."""
    makers = [kink for kink in known if kink.number is not None]
    most = min(len(makers), problem.n - problem.laws.c.numel())
    sets = itertools.chain.from_iterable(itertools.combinations(makers, size) for size in range(2, most + 1))
    found = list(itertools.islice(sets, PARAMETERS.most_meeting + 1))
    return found if len(found) <= PARAMETERS.most_meeting else None


def _begins(search: PointSearch) -> list[Floats]:
    return [search.problem.begin, *search.others(PARAMETERS.tries)]


def _candidates(search: PointSearch, on_kink: StaticProblem) -> Iterator[Floats]:
    """Stationary points on the surface of a kink, with each set of contacts closed: points on it where its gradient
    vanishes, as that of a distance does, and points in balance."""
    problem, length = search.problem, search.scales.length
    scales = rest_equations.scales(on_kink, problem.begin)
    begins = _begins(search)
    for size in range(problem.K + 1):
        for closed in itertools.combinations(range(problem.K), size):
            for begin in begins:
                q = surface_descent.onto(on_kink, begin, closed, scales)
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
        along = str(_along(on_kink, q, tuple(np.flatnonzero(near).tolist())))

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
    problem, sentences, found = search.problem, [], list[Floats]()
    for pole in known:
        if pole.number is not None:
            continue
        on_pole = StaticProblem(_on_kinks(problem.laws, (pole,)), problem.p, (problem.t, problem.begin), 0.0)
        for q in _on_surface(search, on_pole):
            if not any(search.apart(q, other) <= PARAMETERS.same for other in found):
                found.append(q)
                where = ", ".join(f"{name} = {x:.9g}" for name, x in zip(names, q, strict=True))
                what = _beside(search, on_pole, q, value)
                sentences.append(f"at {where} the {value} is not defined, by `{pole.word}`: {what}")
            break
    return sentences[: PARAMETERS.most_named]


def _on_surface(search: PointSearch, on_pole: StaticProblem) -> Iterator[Floats]:
    """Points where a divisor vanishes, within the inequalities."""
    length = search.scales.length
    scales = rest_equations.scales(on_pole, search.problem.begin)
    for begin in _begins(search):
        q = surface_descent.onto(on_pole, begin, (), scales)
        if q is None:
            continue
        g = on_pole.at(on_pole.t, q, on_pole.nothing).g
        if not (g < -doubles.ZERO * search.scales.contacts * length).any():
            yield np.where(np.abs(q) <= PARAMETERS.same * length, 0.0, q)


def _beside(search: PointSearch, on_pole: StaticProblem, q: Floats, value: str) -> str:
    """A sentence on the function beside a place where it has no value."""
    problem, length = search.problem, search.scales.length
    ways = _drawn(rank.null_basis(decompositions.unit(on_pole.at(on_pole.t, q, on_pole.nothing).dc[:-1])))
    ways = np.vstack([ways, -ways])
    far, middle, near = (
        np.array([precise_zeros.value(problem, q + part * length * way) for way in ways])
        for part in PARAMETERS.around
    )
    first, then = middle - far, near - middle
    is_known = np.isfinite(then) & np.isfinite(first)
    wild = (
        is_known
        & (np.abs(then) > PARAMETERS.unbounded * np.abs(first))
        & (np.abs(then) > doubles.ROOT * np.abs(near))
    )
    rises, falls = bool((wild & (then > 0)).any()), bool((wild & (then < 0)).any())
    if rises and falls:
        return f"beside it the {value} grows and falls without bound"
    if rises or falls:
        return f"beside it the {value} {'grows' if rises else 'falls'} without bound"
    if not is_known.any():
        return "an extreme may sit there"
    return f"an extreme may sit there, where the {value} beside it is {near[is_known].mean():.6g}"


def _along(on_kink: StaticProblem, q: Floats, closed: tuple[int, ...]) -> str | None:
    """The type of a point on the surface of a kink, with these contacts closed."""
    scales = rest_equations.scales(on_kink, q)
    x = refine.begun(RestEquations(on_kink, closed, scales), q)
    if x is None:
        return None
    point = refine.settled(RestEquations(on_kink, closed, scales), newton.NewtonEnd(x, 0.0, 0.0))
    if not isinstance(point, refine.EquilibriumPoint):
        return None
    return point_type.classify(on_kink, point, scales, True)[0].kind


def notes(search: PointSearch, names: Sequence[str], value: str) -> list[str]:
    """Sentences on extremes at kinks and poles; `value`: the function that is asked for. Points of another type that
    the search has listed there are none."""
    problem = search.problem
    jumps = _jumps(problem.laws)
    sentences = [f"{jumps} make forces jump: points of rest at a jump are not looked for"] if jumps else []
    known = kinks(problem.laws) if search.options.has_potential else []
    if not known:
        return sentences
    why = _beyond(problem, known)
    if why:
        words = ", ".join(f"`{word}`" for word in dict.fromkeys(kink.word for kink in known))
        return [*sentences, f"{words} may have kinks or poles: extremes there have no lambda, and {why}"]
    sentences += pole_sentences(search, known, names, value)
    if _meeting(problem, known) is None:
        sentences.append("where several kinks meet extremes are not looked for")
    named = list(itertools.islice(extremes(search, known), PARAMETERS.most_named + 1))
    for point in named[: PARAMETERS.most_named]:
        # There derivatives are those of sign(0) = 0 and tell nothing.
        search.points = [
            known
            for known in search.points
            if known.type.kind == point.kind or search.apart(known.point.q, point.q) > PARAMETERS.same
        ]
        where = ", ".join(f"{name} = {x:.9g}" for name, x in zip(names, point.q, strict=True))
        sentences.append(
            f"at {where} `{point.word}` makes a kink, and no lambda is needed for the {point.kind} of the {value}"
            f" there ({value} = {problem.value(point.q):.9g})"
        )
    if len(named) > PARAMETERS.most_named:
        sentences.append("there are extremes at further kinks, which are not named")
    return sentences


def _beyond(problem: StaticProblem, known: Sequence[Kink]) -> str | None:
    """The reason that kinks are not looked at; None where they are."""
    if len(problem.times) > 1:
        return "are not looked for where equations hold t"
    if PARAMETERS.most_contacts < problem.K:
        return "are not looked for among so many inequalities"
    is_large = len(known) > PARAMETERS.most_kinks or problem.n > PARAMETERS.most_coordinates
    return "are not looked for" if is_large else None


def _jumps(laws: StaticLaws) -> str:
    """The words that make forces without a declared potential jump."""
    words = [
        f"`{each.kind.word}`"
        for each in switches.among(laws.driving, [laws.q, laws.t, laws.p])
        if each.kind.is_comparing and each.kind.word and ca.depends_on(each.value, laws.q)
    ]
    return ", ".join(dict.fromkeys(words))
