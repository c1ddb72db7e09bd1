"""All points that can be found: from the start and from seeded others, each refined, and none of them twice.

Every start is gone out from by damped Newton steps, downhill and uphill; then again with the points that are known
taken out of the equations (deflation), so that another is found.
"""

from __future__ import annotations

import dataclasses
import itertools
from collections.abc import Callable, Iterator, Mapping, Sequence

import numpy as np

from lagcli import doubles
from lagcli.arrays import Floats
from lagcli.statics import (
    continuum,
    flat_directions,
    point_type,
    precise_zeros,
    refine,
    rest_equations,
    static_problem,
)
from lagcli.statics.continuum import FoundPoint, KnownContinua
from lagcli.statics.rest_equations import EquilibriumPoint, RestEquations
from lagcli.statics.static_problem import StaticProblem

Flags = tuple[bool, ...]
Contacts = tuple[int, ...]
Region = Callable[[Floats], bool]


class SearchParameters:
    """Numbers of the search for all points.

    The tests are of `tests/physics/test_statics.py`, `tests/physics/test_homotopy.py`,
    `tests/unit/test_numbers_of_rest_searches.py` and `tests/unit/test_numbers_of_statics.py`.
    """

    __slots__ = ()

    budget: float = 1.5e7
    """Work of a search in operations, some ten seconds of a processor of 2023.
    At 1.5e5 `test_a_ring_is_one_point_with_its_dimension` fails."""
    first: int = 4
    """The part of it that the declared start may take, and the part that goes into what lies on which continuum.
    `test_the_first_start_takes_a_quarter_of_the_budget` fails at 1 and 40."""
    same_of_flat: float = 3e-4
    """The distance of two points that are one, as a part of the size of things, where they are degenerate, and found to
    the root of rounding alone. `test_points_that_are_one_are_kept_once` fails at 3e-5 and 0.003."""
    spread: tuple[float, ...] = (0.3, 1.0, 2.5)
    """How far starts are drawn from the start of the model, in turn: beside it, across, and beyond.
    `test_starts_are_drawn_beside_across_and_beyond` fails at a tenth and at ten times of it."""
    paths: int = 8
    """Starts from which a homotopy is followed. At 0 `test_a_path_leads_to_what_all_else_has_missed` fails."""
    most_coordinates: int = 12
    """Of more coordinates places without lambda are not looked for: starts at random find none in so many dimensions.
    `test_kinks_are_looked_at_among_twelve_coordinates` fails at 1 and 120."""
    most_contacts: int = 3
    """Contacts, every set of which is closed in turn, for such places and to count all points; of more none is.
    `test_kinks_are_looked_at_among_three_contacts` fails at 0 and 30."""
    most_named: int = 4
    """Places that notes of one kind name. `test_four_undecided_pieces_are_named` fails at 0 and 40."""
    uneven: float = 1.0371
    """The end of the first shell of a line in sizes of things: no decimal number is one, for there zeros are likely.
    `test_all_zeros_of_one_unknown_lie_within_a_million_sizes` fails at 0.10371 and 10.371."""


PARAMETERS = SearchParameters()


@dataclasses.dataclass(frozen=True, slots=True, eq=False)
class SearchOptions:
    """pushes: contacts push (rest), or pull too (stationary points); angles (n,): coordinates with a period of the
    equations; repeating (n,): those in which points a turn apart are two, and the one next to the start is taken."""

    has_potential: bool
    pushes: bool
    angles: Flags
    seed: int
    repeating: Flags = ()


class PointSearch:
    """One search; `points` grows, `best_residual` is the least where none is found."""

    def __init__(self, problem: StaticProblem, options: SearchOptions) -> None:
        self.problem, self.options = problem, options
        self.scales = rest_equations.scales(problem, problem.begin)
        self.free = RestEquations(problem, (), self.scales)  # the equations without contacts
        self._continua = KnownContinua(self.free, options.angles)
        self._angles = np.array(options.angles, dtype=bool)
        self.points: list[FoundPoint] = []
        self.best_residual = np.inf
        self.starts = 0
        self.are_beyond = False
        self._allowed = PARAMETERS.budget
        self._on_continua = 0.0
        self._decided: dict[Contacts, Region] = {}
        self._vain = 0
        # Sets of closed contacts, 64 at most
        sets = itertools.takewhile(lambda closed: len(closed) <= problem.n, problem.contact_sets())
        self._sets = list(itertools.islice(sets, 64))
        self.is_cut = next(sets, None) is not None

    def run(self, others: int) -> None:
        """Search from the declared start, if that has not been, and from so many others: first to the points next to
        each, then round them with what is left of the budget, of which each has its part."""
        if not self.starts:
            self._allowed = PARAMETERS.budget / PARAMETERS.first
            for closed in self._start(self.problem.begin):
                self._around(self.problem.begin, closed, is_followed=True)
        begun: list[tuple[Floats, Contacts]] = []
        for number, begin in enumerate(self.others(others)):
            if self._is_at_end():
                return
            self._allowed = self.spent + (PARAMETERS.budget - self.spent) / (others - number)
            begun += [(begin, closed) for closed in self._start(begin)]
        for number, (begin, closed) in enumerate(begun):
            if self._is_vain() and number >= PARAMETERS.paths:
                return
            if self._is_at_end():
                return
            # Paths cost most: one that is followed has the part of two.
            sharing = (len(begun) - number) / (2 if number < PARAMETERS.paths else 1)
            self._allowed = self.spent + (PARAMETERS.budget - self.spent) / max(1.0, sharing)
            self._around(begin, closed, is_followed=number < PARAMETERS.paths)

    def _is_at_end(self) -> bool:
        # Nobody reads more points, and each is taken out of the equations of the next.
        if self.spent <= PARAMETERS.budget and len(self.points) < 400:
            return False
        self.is_cut = True
        return True

    def _is_vain(self) -> bool:
        """True if the last twelve rounds have found no new point."""
        return self._vain >= 12

    def settle(
        self, exact: Mapping[Contacts, Sequence[EquilibriumPoint]], region: Region | None = None
    ) -> bool:
        """Put all points of some sets of contacts, as far as a region is decided, in the place of those that were
        found; nothing further is taken there. False if a regular point was found that is none of them, which stays."""
        own: list[FoundPoint] = []
        has_potential, is_whole = self.options.has_potential, region is None
        is_decided = region or (lambda q: True)
        for point in itertools.chain.from_iterable(exact.values()):
            if not np.isfinite(self.problem.value(point.q)):
                continue
            # Beside an undecided piece zeros may be those of rounded numbers, and one to the digits of the function.
            kind, moved = point_type.classify(self.free, point, has_potential, is_exact=is_whole)
            is_one = moved.q is not point.q and not is_whole
            if is_one and any(self.apart(each.point.q, moved.q) <= doubles.ROOT for each in own):
                continue
            own.append(FoundPoint(moved if is_one else point, kind, 0, point.closed))
        same = PARAMETERS.same_of_flat
        left = [
            known
            for known in self.points
            if (known.dimension and known.point.closed not in exact)
            or not any(self.apart(known.point.q, one.point.q) <= same for one in own)
        ]
        outside = [one for one in left if one.point.closed not in exact or not is_decided(one.point.q)]
        strange = [one for one in left if one not in outside and one.type.is_regular]
        # The end of an edge of zeros is a zero of the edge's neighbour too.
        own = [one for one in own if not any(self._continua.is_on(known, one) for known in outside)]
        self.points = own + outside + strange
        self._decided |= dict.fromkeys(exact, is_decided)
        if is_whole:
            self._sets = [closed for closed in self._sets if closed not in exact]
        return not strange

    def leave_out(self, closed: Contacts) -> bool:
        """Search a set of contacts no more whose points are one continuum, if one of them is known."""
        if is_known := any(one.point.closed == closed and one.dimension for one in self.points):
            self._sets = [each for each in self._sets if each != closed]
        return is_known

    def _start(self, begin: Floats) -> list[Contacts]:
        """Search next to a start; the sets of contacts with which that was done."""
        first, problem, has_potential = not self.starts, self.problem, self.options.has_potential
        waits = has_potential and problem.is_large
        if first:
            self._take_nearest(begin, () if waits else refine.OFFSETS)
        elif problem.K and self.options.pushes:
            self.take(refine.pushed(self.free, begin))
        sets = self._sets
        if not first and len(sets) > 4:
            sets = [sets[self.starts % len(sets)]]
        for closed in sets:
            equations = self.free.closing(closed)
            self.take(refine.reached(equations, begin))
            is_large = equations.size > static_problem.LARGE
            is_asked = has_potential and (first or not is_large)
            for sign in ((1.0,) if is_large else (1.0, -1.0)) if is_asked else ():
                point = refine.lowest(equations, begin, sign)
                if point is not None:
                    self.take(refine.reached(equations, point))
            if self.spent > self._allowed:
                break
        if first and waits and not self.points:
            self._take_nearest(begin, refine.OFFSETS)
        self.starts += 1
        return sets

    def _take_nearest(self, begin: Floats, asides: Sequence[float]) -> None:
        """Keep the point reached from the start, which is always among the answers."""
        if self.options.pushes or not self.problem.K:
            self.take(refine.nearest_equilibrium(self.problem, begin, asides))
        else:
            self.take(refine.reached(self.free, begin))

    def _around(self, begin: Floats, closed: Contacts, is_followed: bool) -> None:
        """Further points round a start: along a path if it is followed, and without those that are known."""
        equations = self.free.closing(closed)
        x = equations.begun(begin)
        if equations.size > static_problem.LARGE or self.spent > self._allowed or x is None:
            return
        vain = 0
        for point in refine.near_zeros(equations, x) if is_followed else ():
            # Along a continuum a path goes to and fro over zero without end.
            if vain >= 12 or self.spent > self._allowed:
                break
            vain = 0 if self._refine(equations, point) else vain + 1
        for _ in range(0 if self._is_vain() else 2):
            known = [one.point.q for one in self.points if not one.dimension and one.point.closed == closed]
            if not known or self.spent > self._allowed:
                return
            end = refine.solve(refine.deflated(equations, known, self.options.angles), x, 60)
            self._vain += 1
            if end is None or not np.isfinite(end.x).all() or not self._refine(equations, end.x):
                return
            self._vain = 0

    def _refine(self, equations: RestEquations, x: Floats) -> bool:
        """Keep the point that Newton's steps lead to; True if it is new."""
        if equations(x) is None:
            return False
        end = refine.refined(equations, x)
        return self.take(equations.settled(end.x, end.moved))

    @property
    def spent(self) -> float:
        """The work so far: evaluations times the cost of one."""
        unknowns = self.problem.n + self.problem.C + self.problem.K
        # Of many unknowns what one evaluation leads to is mostly sparse algebra.
        each = unknowns**3 / 50 if unknowns <= static_problem.DENSE else unknowns**3 / 5000 + 5000.0
        made = self.problem.evaluations * (len(self.problem.times) * each + 1000.0)
        return made - self._on_continua

    def take(self, found: EquilibriumPoint) -> bool:
        """Keep a point that is new; True if it is."""
        if not found.rests:
            self.best_residual = min(self.best_residual, found.residual)
            return False
        found = dataclasses.replace(found, q=self.wrapped_angles(found.q))
        pulling, below = self.free.wrong_side(found)
        if below or (pulling and self.options.pushes) or self._is_known(found, doubles.ROOT):
            return False
        if found.closed in self._decided and self._decided[found.closed](found.q):
            return False
        if self.problem.is_beyond(found.q):
            self.are_beyond = True
            return False
        found = continuum.with_own_contacts(self.free, found)
        before = self.spent
        is_new = self._add(found)
        if not is_new or self.points[-1].dimension:
            self._on_continua += self.spent - before
        return is_new

    def _add(self, found: EquilibriumPoint) -> bool:
        """Keep a point of its own; False for one of a known continuum."""
        equations = self.free.closing(found.closed)
        x = equations.unknowns(found.q)
        is_tired = self._on_continua > PARAMETERS.budget / PARAMETERS.first
        if self._is_known(found, PARAMETERS.same_of_flat) and continuum.directions(equations, x).size:
            return False
        nearest, is_exact = _nearest_zero(equations, found)
        if nearest is None or (nearest is not found and self._is_known(nearest, doubles.ROOT)):
            return False
        typed = _typed_zero(equations, nearest, self.options.has_potential, is_exact)
        if typed is None or (typed.point is not nearest and self._is_known(typed.point, doubles.ROOT)):
            return False
        found, kind, size = typed.point, typed.type, typed.dimension
        near = (one for one in self.points if one.dimension and not self._continua.differ(one.point, found))
        if is_tired and not kind.is_regular and any(near):
            return False  # it is compared with the known continua no more, for that costs more than all else
        ones = [known for known in self.points if size and self._continua.are_one(known, typed)]
        if ones:  # of which it may join several
            self.points = [known for known in self.points if known not in ones[1:]]
            return False
        if any(self._continua.is_on(known, typed) for known in self.points):
            return False
        self.points = [known for known in self.points if not self._continua.is_on(typed, known)]
        if not size:
            # Coordinates that are nearly zero are zero, where that is no worse: there rounding hides the last digits,
            # at a flat point the last half of them.
            limit = PARAMETERS.same_of_flat if kind.kind == "degenerate" else 4 * doubles.EPS
            q = np.where(np.abs(found.q) <= limit * self.scales.length, 0.0, found.q)
            begun = None if np.array_equal(q, found.q) else equations.begun(q)
            # Not refined: a further step would bring the rounding back.
            tidy = None if begun is None else equations.settled(begun)
            worst = max(found.residual, 4 * doubles.EPS * self.scales.force)
            if tidy is not None and tidy.rests and tidy.residual <= worst:
                if self._is_known(tidy, doubles.ROOT):
                    return False
                found = tidy
        self.points.append(dataclasses.replace(typed, point=found))
        return True

    def wrapped_angles(self, q: Floats) -> Floats:
        """q with angles between -pi and pi, or within half a turn of the start where turns differ."""
        turned, angles = np.array(q), self._angles
        centres = np.where(self.options.repeating or False, self.problem.begin, 0.0)
        turned[angles] = (centres + np.pi - np.remainder(centres + np.pi - turned, 2 * np.pi))[angles]
        # -pi and pi are one angle, and rounding decides nothing.
        is_end = angles & (np.abs(turned - centres + np.pi) < 1e-9)
        turned[is_end] = centres[is_end] + np.pi
        return turned

    def apart(self, a: Floats, b: Floats) -> float:
        """The distance of two configurations, as a part of the size of things."""
        d, angles = np.abs(a - b), self._angles
        d[angles] = np.minimum(np.remainder(d[angles], 2 * np.pi), np.remainder(-d[angles], 2 * np.pi))
        d[~angles] /= self.scales.length
        return float(d.max(initial=0.0))

    def _is_known(self, found: EquilibriumPoint, of_flat: float) -> bool:
        """True if a point is one of those that are known; of_flat: how near to one where a curvature vanishes."""
        return any(
            self.apart(known.point.q, found.q)
            <= (of_flat if not known.type.is_regular and not known.dimension else doubles.ROOT)
            for known in self.points
        )

    def others(self, count: int) -> Iterator[Floats]:
        """Starts beside the declared one: angles anywhere, the rest at several distances."""
        problem, angles, spreads = self.problem, self._angles, PARAMETERS.spread
        random = np.random.default_rng(self.options.seed)
        for number in range(count):
            spread = spreads[number % 3] * self.scales.length
            centre = problem.begin if number % 2 else np.zeros(problem.n)
            q = centre + spread * random.standard_normal(problem.n)
            q[angles] = random.uniform(-np.pi, np.pi, int(angles.sum()))
            if not number:
                q = np.zeros(problem.n)  # where much is symmetric
            point = refine.onto(self.free, q)
            yield q if point is None else point


def typed_point(equations: RestEquations, found: EquilibriumPoint, has_potential: bool) -> FoundPoint | None:
    """A point of equations with its type and more digits; None where it is far away, or balanced by rounding alone."""
    nearest, is_exact = _nearest_zero(equations, found)
    return None if nearest is None else _typed_zero(equations, nearest, has_potential, is_exact)


def _nearest_zero(equations: RestEquations, found: EquilibriumPoint) -> tuple[EquilibriumPoint | None, bool]:
    """The point that is meant by one that may be degenerate, or None; and if it is known in many digits."""
    x = equations.unknowns(found.q)
    is_rounding = equations.rounding(x) > doubles.ZERO
    if not is_rounding and not precise_zeros.is_doubtful(equations, x):
        return found, False
    zero = precise_zeros.nearest(equations, x)
    if zero is None and (program := precise_zeros.known(equations, x)) is not None:
        # Where the balance is rounding, and many digits lead nowhere, multipliers grow without bound.
        zero = None if is_rounding else precise_zeros.led_to(equations, program, x)
        if zero is None:
            return None, False
    if zero is None or zero is x:
        return found, False
    if equations(zero) is None:
        return None, True  # sin(x)/x has no value at 0, and beside it a zero of its slope in rounding alone
    again = equations.settled(zero)
    return (again if again.rests else None), True


def _typed_zero(
    equations: RestEquations, found: EquilibriumPoint, has_potential: bool, is_exact: bool
) -> FoundPoint | None:
    problem = equations.problem
    if not np.isfinite(problem.value(found.q)):
        return None  # beyond the domain, as of log(x) + x at -1, where the gradient vanishes all the same
    x = equations.unknowns(found.q)
    along = continuum.tangent(equations, x)
    beside = continuum.beside_crossing(equations, x) if along.size else x
    if beside is x:
        kind, moved = point_type.classify(equations, found, has_potential, along, is_exact)
    else:  # which has the type of its branches, whose directions a crossing has together
        moved, own = found, continuum.tangent(equations, beside)
        other = equations.settled(beside)
        if not other.rests:
            return None
        kind, _ = point_type.classify(equations, other, has_potential, own)
    if moved.q is not found.q:
        x = equations.unknowns(moved.q)
        again = equations.settled(x)
        if not again.rests:
            return None
        found = again
    flat = continuum.directions(equations, x)
    if not kind.is_regular and (kind.kind == "degenerate" or flat.size):
        way = np.abs(found.q - problem.begin).max(initial=0.0)
        is_far = way > rest_equations.FAR * equations.scales.length
        exact = None if is_far else flat_directions.balanced(equations, found, flat)
        if exact is None:
            return None
        found = exact
    return FoundPoint(found, kind, along.shape[1], equations.touching(found))
