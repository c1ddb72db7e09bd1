"""Points where the function has a kink: there it may have an extreme that no lambda balances.

The shortest sum of distances to the corners of an obtuse triangle is that from the corner itself; |x - 1| + x^2/4 is
least at 1. Where u vanishes in sqrt(u), |u|, u^(1/3) or the difference u of min and max, the stationary points on the
surface u = 0 are candidates; whether the function rises from one of them, or falls, its slopes on both sides say.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Iterator, Sequence
from typing import NamedTuple

import casadi as ca
import numpy as np
import numpy.typing as npt

from lagcli.smoothness import operation_graph, switches
from lagcli.statics import newton, point_type, refine, rest_equations, surface_descent
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
    zero: float = 1e-9
    """Coordinates of a kink that are this part of the size of things are zero.
    `test_a_coordinate_of_a_kink_is_zero_to_nine_digits` fails at 1e-10 and 1e-8."""
    slope: float = 1e-6
    """Slopes beside a kink of this part of the forces are none.
    `test_a_slope_of_six_digits_less_is_none` fails at 1e-7 and 1e-5."""
    most_named: int = 4
    """Points that notes name; `test_notes_name_four_kinks` fails at 0 and 40."""


PARAMETERS = KinkSearchParameters()


class Kink(NamedTuple):
    """A kink where `argument` (1, 1) is zero; value: the function as it is there; word: what makes it."""

    word: str
    argument: ca.SX
    value: ca.SX


@dataclasses.dataclass(frozen=True, slots=True, eq=False)
class KinkPoint:
    """An extreme at a kink."""

    word: str
    q: Floats
    kind: str


def kinks(laws: StaticLaws) -> list[Kink]:
    """The kinks of the function, by its operations; none of those whose arguments do not vary."""
    inputs, value = [laws.q, laws.t, laws.p], ca.densify(laws.value)
    arguments = [(each.kind.word, _argument(each.op, each.parts)) for each in switches.among(value, inputs)]
    found = [(word, u) for word, u in arguments if u is not None and ca.depends_on(u, laws.q)]
    return [
        Kink(word, argument, _with_kink(laws, value, inputs, number))
        for number, (word, argument) in enumerate(found)
    ]


def _with_kink(laws: StaticLaws, value: ca.SX, inputs: list[ca.SX], number: int) -> ca.SX:
    """The function with the result of one of its kinks as it is at the kink."""
    passed = 0

    def put(op: int, parts: list[ca.SX], result: ca.SX) -> ca.SX:
        nonlocal passed
        argument = _argument(op, parts)
        if argument is None or not ca.depends_on(argument, laws.q):
            return result
        passed += 1
        if passed - 1 != number:
            return result
        return parts[0] if op in (ca.OP_FMIN, ca.OP_FMAX) else ca.SX(0)

    return operation_graph.replayed(value, inputs, put)


def _argument(op: int, parts: Sequence[ca.SX]) -> ca.SX | None:
    """Return what is zero at the kink of an operation; None where it has none."""
    if op in (ca.OP_FABS, ca.OP_SQRT):
        return parts[0]
    if op in (ca.OP_FMIN, ca.OP_FMAX):
        return parts[0] - parts[1]
    if op in (ca.OP_POW, ca.OP_CONSTPOW) and parts[1].is_constant():
        power = float(parts[1])
        return parts[0] if 0 < power != round(power) else None
    return None


def _on_kink(laws: StaticLaws, kink: Kink) -> StaticLaws:
    """The problem on the surface u = 0."""
    return dataclasses.replace(
        laws,
        F=ca.densify(-ca.gradient(kink.value, laws.q)),
        B=ca.vertcat(laws.B, ca.jacobian(kink.argument, laws.q)),
        c=ca.densify(ca.vertcat(laws.c, kink.argument)),
        value=kink.value,
    )


def extremes(search: PointSearch) -> Iterator[KinkPoint]:
    """Extremes at kinks, as far as they are found."""
    problem = search.problem
    found: list[Floats] = []
    for kink in kinks(problem.laws):
        laws = _on_kink(problem.laws, kink)
        on_kink = StaticProblem(laws, problem.p, (problem.t, problem.begin), 0.0)
        for q in _candidates(search, on_kink):
            if any(search.apart(q, other) <= PARAMETERS.same for other in found):
                continue
            kind = _kind(search, on_kink, q)
            if kind is not None:
                found.append(q)
                yield KinkPoint(kink.word, q, kind)


def _candidates(search: PointSearch, on_kink: StaticProblem) -> Iterator[Floats]:
    """Stationary points on the surface of a kink: points on it where its gradient vanishes, as that of a distance
    does, and points in balance."""
    problem, random = search.problem, np.random.default_rng(search.options.seed + 2)
    length = search.scales.length
    begins = [problem.begin]
    begins += [problem.begin + length * random.standard_normal(problem.n) for _ in range(PARAMETERS.tries)]
    scales = rest_equations.scales(on_kink, problem.begin)
    for begin in begins:
        q = surface_descent.onto(on_kink, begin, (), scales)
        if q is None:
            continue
        row = on_kink.at(on_kink.t, q, on_kink.nothing).dc[-1]
        if (
            np.linalg.norm(row) <= PARAMETERS.isolated * scales.conditions[-1]
            or problem.n == on_kink.laws.c.numel()
        ):
            yield np.where(np.abs(q) <= PARAMETERS.zero * length, 0.0, q)
            continue
        point = refine.reached(on_kink, q, (), scales)
        if isinstance(point, refine.EquilibriumPoint):
            yield point.q


def _kind(search: PointSearch, on_kink: StaticProblem, q: Floats) -> str | None:
    """`minimum` or `maximum` at a kink, by the slopes beside it; None where it is none, or open."""
    problem, h = search.problem, PARAMETERS.beside * search.scales.length
    here = problem.value(q)
    if not np.isfinite(here):
        return None
    values = on_kink.at(on_kink.t, q, on_kink.nothing)
    rows = point_type.unit(values.dc[:-1])
    Z = point_type.kernel(rows)
    normal = Z.T @ values.dc[-1]
    size = float(np.linalg.norm(normal))
    along = "isolated"
    if size > PARAMETERS.isolated * max(1.0, float(np.linalg.norm(values.dc[-1]))) and Z.shape[1] > 1:
        ways = (Z @ normal / size)[None]
        along = str(_along(on_kink, q))
    else:
        drawn = np.random.default_rng(5).standard_normal((8 * Z.shape[1], Z.shape[1]))
        ways = (drawn / np.linalg.norm(drawn, axis=1, keepdims=True)) @ Z.T
    slopes = np.array(
        [(problem.value(q + sign * h * way) - here) / h for way in ways for sign in (1.0, -1.0)]
    )
    floor = PARAMETERS.slope * max(float(np.abs(slopes).max()), search.scales.force)
    if (slopes > floor).all() and along in ("isolated", "minimum"):
        return "minimum"
    if (slopes < -floor).all() and along in ("isolated", "maximum"):
        return "maximum"
    return None


def _along(on_kink: StaticProblem, q: Floats) -> str | None:
    """The type of a point on the surface of a kink."""
    scales = rest_equations.scales(on_kink, q)
    x = refine.begun(RestEquations(on_kink, (), scales), q)
    if x is None:
        return None
    point = refine.settled(RestEquations(on_kink, (), scales), newton.NewtonEnd(x, 0.0, 0.0))
    if not isinstance(point, refine.EquilibriumPoint):
        return None
    return point_type.classify(on_kink, point, scales, True)[0].kind


def notes(search: PointSearch, names: Sequence[str], value: str) -> list[str]:
    """Sentences on extremes at kinks; `value`: the function that is asked for. Points of another type that the search
    has listed there are none."""
    problem = search.problem
    if problem.K or len(problem.times) > 1:
        return []
    known = kinks(problem.laws)
    if not known:
        return []
    if len(known) > PARAMETERS.most_kinks or problem.n > PARAMETERS.most_coordinates:
        words = ", ".join(f"`{word}`" for word in dict.fromkeys(kink.word for kink in known))
        return [f"{words} may have kinks: extremes there have no lambda, and are not looked for"]
    sentences = []
    for point in extremes(search):
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
    return sentences[: PARAMETERS.most_named]
