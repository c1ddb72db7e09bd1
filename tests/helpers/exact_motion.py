"""Motions under forces and walls that are polynomials of t between switches, by exact events: a second way to them.

Coordinates u with masses m, forces F(t) that jump and bend at given times or where a coordinate passes a value, linear
rows a.u = c, and one-sided rows a.u >= w(t). Between two incidents u is a polynomial of t; an incident is the first
zero of a polynomial, in sixty digits. What a contact does is decided coefficient by coefficient of the powers of t, so
that no tolerance stands beside the zero of sixty digits. A series of impacts that crowds below 1e-20 ends in its limit.
"""

from __future__ import annotations

import dataclasses
import itertools
import math
from collections import deque
from collections.abc import Callable, Sequence
from typing import Any

import mpmath

MP = mpmath.MPContext()
MP.dps = 60
ZERO = MP.mpf(10) ** -35
# Times are known to this, and polynomials where they turn.
LAST, TOUCHING = MP.mpf(10) ** -52, MP.mpf(10) ** -50
# Three impacts of one contact within this time have an end at once: fewer may go down a chain whose gaps are as small.
# Contacts that were struck as lately as `LATELY` take part in it. Gaps and speeds below `NEAR` close then.
CROWDED, LATELY, NEAR = MP.mpf(10) ** -20, MP.mpf(10) ** -12, MP.mpf(10) ** -16

Number = Any  # of sixty digits
Vector = list[Number]
Polynomial = list[Number]  # constant first


class Undecided(Exception):
    """The exact motion ends here: no law decides, or no end of impacts is in sight."""


@dataclasses.dataclass(frozen=True, slots=True)
class Law:
    """A function of t: powers c_k t**k, and bends c*max(0, t - s)**power; power 0 is a jump by c at s."""

    powers: tuple[str, ...] = ()
    bends: tuple[tuple[str, str, int], ...] = ()

    def text(self) -> str:
        """As a model file has it."""
        terms = [f"({c})*t**{k}" if k else f"({c})" for k, c in enumerate(self.powers)]
        for s, c, power in self.bends:
            terms.append(f"({c})*max(0, t - {s})**{power}" if power else f"({c})*(1 + sign(t - {s}))/2")
        return " + ".join(terms) or "0"

    def switches(self) -> set[str]:
        return {s for s, _, _ in self.bends}

    def taylor(self, t: Number) -> Polynomial:
        """Its coefficients about t, on the later side."""
        found = _moved([MP.mpf(c) for c in self.powers], t)
        for s, c, power in self.bends:
            if t >= MP.mpf(s) - ZERO:
                found = _sum(found, _moved([*[MP.zero] * power, MP.mpf(c)], t - MP.mpf(s)))
        return found


@dataclasses.dataclass(frozen=True, slots=True)
class Wall:
    """a.u - w(t), for each piece; `joined` by min or max where there are several. e is the restitution."""

    name: str
    pieces: tuple[tuple[tuple[str, ...], Law], ...]
    e: str = "0"
    joined: str = "max"


@dataclasses.dataclass(frozen=True, slots=True)
class Relay:
    """A force size*sign(u_of - value) on a coordinate."""

    on: int
    of: int
    value: str
    size: str


@dataclasses.dataclass(frozen=True, slots=True)
class System:
    """masses, u, v (n,), forces (n,), walls, linear rows, and how long."""

    masses: tuple[str, ...]
    u: tuple[str, ...]
    v: tuple[str, ...]
    forces: tuple[Law, ...]
    walls: tuple[Wall, ...]
    relays: tuple[Relay, ...] = ()
    rows: tuple[tuple[str, ...], ...] = ()
    start: str = "0"
    duration: str = "3"


@dataclasses.dataclass(frozen=True, slots=True)
class Happening:
    """kind: `impact`, `end` of a series, or `release`; walls: those that took part; before, after: v (n,)."""

    t: float
    kind: str
    walls: tuple[str, ...]
    before: tuple[float, ...]
    after: tuple[float, ...]


@dataclasses.dataclass(frozen=True, slots=True)
class Leg:
    """From t on: u and the force of each piece of a wall that is closed, as polynomials of t - t0."""

    t: Number
    u: tuple[Polynomial, ...]
    pushes: tuple[tuple[str, Polynomial], ...]
    is_unique: bool


@dataclasses.dataclass(frozen=True, slots=True)
class Motion:
    """What happened, and the legs; why: the reason where it ends before its time, at `until`."""

    happenings: list[Happening]
    legs: list[Leg]
    until: float
    why: str

    def at(self, t: float) -> tuple[list[float], list[float], dict[str, float], bool]:
        """Positions, velocities and multipliers at t, on the later side; whether these are unique."""
        # A time of a table is a switch to rounding.
        leg = [leg for leg in self.legs if leg.t <= t + 4 * math.ulp(t)][-1]
        s = MP.mpf(t) - leg.t
        pushes: dict[str, float] = {}
        for name, p in leg.pushes:
            pushes[name] = pushes.get(name, 0.0) + float(_at(p, s))
        u = [float(_at(p, s)) for p in leg.u]
        return u, [float(_at(_slope(p), s)) for p in leg.u], pushes, leg.is_unique


def _at(p: Polynomial, x: Number) -> Number:
    value = MP.zero
    for c in reversed(p):
        value = value * x + c
    return value


def _slope(p: Polynomial) -> Polynomial:
    return [k * c for k, c in enumerate(p)][1:] or [MP.zero]


def _sum(p: Polynomial, q: Polynomial, times: Number = 1) -> Polynomial:
    return [a + times * b for a, b in itertools.zip_longest(p, q, fillvalue=MP.zero)]


def _moved(p: Polynomial, t: Number) -> Polynomial:
    """The coefficients of p about t, by Horner's rule."""
    found = list(p)
    for k in range(len(found)):
        for j in range(len(found) - 2, k - 1, -1):
            found[j] += t * found[j + 1]
    return found


def _sign(p: Polynomial) -> int:
    """The sign of p just after zero."""
    return next((1 if c > 0 else -1 for c in p if abs(c) > ZERO), 0)


def _zeros(p: Polynomial, end: Number) -> list[Number]:
    """The zeros in (0, end] at which p changes its sign."""
    if not p or abs(p[0]) > sum(abs(c) * end**k for k, c in enumerate(p) if k):
        return []
    return _zeros_and_turns(p, end)[0]


def _zeros_and_turns(p: Polynomial, end: Number) -> tuple[list[Number], list[Number]]:
    """The zeros in (0, end] at which p changes its sign, and with them those of all its derivatives: between two of
    these it changes its sign once, and where it is zero of a higher order one of them is simple."""
    while p and abs(p[-1]) <= ZERO:
        p = p[:-1]
    if len(p) < 2:
        return [], []
    if len(p) == 2:
        zero = -p[0] / p[1]
        return ([zero], [zero]) if ZERO < zero <= end else ([], [])
    slope, found = _slope(p), []
    _, turns = _zeros_and_turns(slope, end)
    # The last place where it is clearly on one side, and the first after it where it is on none.
    low, sign, none = MP.zero, _sign(p), None
    for high in [*turns, end]:
        value = _at(p, high)
        if abs(value) <= TOUCHING:
            none = high if none is None else none
            continue
        now = 1 if value > 0 else -1
        if now == -sign:
            found.append(none if none is not None else _between(p, slope, (low, high), MP.mpf(sign)))
        low, sign, none = high, now, None
    return found, sorted({*turns, *found})


def _between(p: Polynomial, slope: Polynomial, span: tuple[Number, Number], at_low: Number) -> Number:
    """The zero between two times, by Newton's steps that stay between them."""
    (low, high), x = span, (span[0] + span[1]) / 2
    for _ in range(400):
        value, rate = _at(p, x), _at(slope, x)
        if rate and abs(value) <= LAST * abs(rate):
            return x
        if value * at_low > 0:
            low = x
        else:
            high = x
        ahead = x - value / rate if rate else low
        x = ahead if low < ahead < high else (low + high) / 2
        if high - low <= LAST:
            return x
    return x


def solve(system: System, most: int = 2_000) -> Motion:
    """The motion of a system up to its end, or to where no law decides."""
    flight = _Flight(system)
    try:
        flight.begin()
        while flight.t < flight.end and len(flight.happenings) < most:
            flight.advance()
    except Undecided as reason:
        return Motion(flight.happenings, flight.legs, float(flight.t), str(reason))
    why = "" if flight.t >= flight.end else "too many impacts"
    return Motion(flight.happenings, flight.legs, float(flight.t), why)


@dataclasses.dataclass(frozen=True, slots=True)
class _Piece:
    """A piece of a wall: its number, its wall, its row and its law."""

    number: int
    wall: Wall
    row: Vector
    law: Law


class _Flight:
    def __init__(self, system: System) -> None:
        self.system, self.t = system, MP.mpf(system.start)
        self.end = self.t + MP.mpf(system.duration)
        self.u, self.v = ([MP.mpf(c) for c in part] for part in (system.u, system.v))
        self.n = len(self.u)
        self.pieces = [
            _Piece(number, wall, [MP.mpf(c) for c in row], law)
            for number, (wall, row, law) in enumerate(
                (wall, *piece) for wall in system.walls for piece in wall.pieces
            )
        ]
        self.P = self._projected_inverse()
        count = range(len(self.pieces))
        ahead = [self._dot(self.P, piece.row) for piece in self.pieces]
        self.D = [[_inner(self.pieces[i].row, ahead[j]) for j in count] for i in count]
        self.response = ahead
        times = {s for law in (*system.forces, *(p.law for p in self.pieces)) for s in law.switches()}
        self.switches = sorted(MP.mpf(s) for s in times)
        self.happenings: list[Happening] = []
        self.legs: list[Leg] = []
        self.recent: deque[tuple[Number, list[int]]] = deque(maxlen=40)
        self.closed: tuple[int, ...] = ()

    def _projected_inverse(self) -> list[Vector]:
        """M^-1 - M^-1 B' (B M^-1 B')^-1 B M^-1 of the linear rows B."""
        inverse = [1 / MP.mpf(m) for m in self.system.masses]
        P = [[inverse[i] if i == j else MP.zero for j in range(self.n)] for i in range(self.n)]
        rows = [[MP.mpf(c) for c in row] for row in self.system.rows]
        for row in rows:  # one at a time: each is projected onto those before it
            ahead = self._dot(P, row)
            length = _inner(row, ahead)
            P = [[P[i][j] - ahead[i] * ahead[j] / length for j in range(self.n)] for i in range(self.n)]
        return P

    @staticmethod
    def _dot(matrix: list[Vector], vector: Sequence[Number]) -> Vector:
        return [_inner(row, vector) for row in matrix]

    def begin(self) -> None:
        self._impacts()
        self._decide()

    # What is true at an instant

    def _gap(self, piece: _Piece) -> Polynomial:
        """g and its rate now, on the later side."""
        w = [*piece.law.taylor(self.t), MP.zero, MP.zero]
        return [_inner(piece.row, self.u) - w[0], _inner(piece.row, self.v) - w[1]]

    def _active(self, g: Callable[[_Piece], Polynomial]) -> list[_Piece]:
        """The pieces that act: each of a minimum, and the largest of a maximum just after now."""
        found = []
        for wall in self.system.walls:
            pieces = [p for p in self.pieces if p.wall is wall]
            if wall.joined == "max":
                best = pieces[0]
                for other in pieces[1:]:
                    if _sign(_sum(g(other), g(best), -1)) > 0:
                        best = other
                pieces = [best]
            found += pieces
        return found

    def _free(self) -> list[Polynomial]:
        """Accelerations without contacts, about now."""
        forces = [law.taylor(self.t) or [MP.zero] for law in self.system.forces]
        for relay in self.system.relays:
            side = _sign([self.u[relay.of] - MP.mpf(relay.value), self.v[relay.of]])
            if side == 0:
                raise Undecided("a relay at rest on its switch")
            forces[relay.on] = _sum(forces[relay.on], [side * MP.mpf(relay.size)])
        degree = max(len(f) for f in forces)
        forces = [f + [MP.zero] * (degree - len(f)) for f in forces]
        columns = [self._dot(self.P, [f[k] for f in forces]) for k in range(degree)]
        return [[column[i] for column in columns] for i in range(self.n)]

    def _decide(self) -> None:
        """Choose the closed contacts from here on, and begin a leg."""
        free = self._free()
        near = [p for p in self.pieces if abs(self._gap(p)[0]) <= ZERO and abs(self._gap(p)[1]) <= ZERO]
        second = {
            p.number: _sum(_combined(p.row, free), _bend(p.law.taylor(self.t)), -1) for p in self.pieces
        }

        def g(piece: _Piece) -> Polynomial:
            return [*self._gap(piece), *[c / (k + 1) / (k + 2) for k, c in enumerate(second[piece.number])]]

        level = [p for p in self._active(g) if p in near]
        numbers = [p.number for p in level]
        chosen, forces = self._complementary(numbers, second)
        self.closed = chosen
        a = free
        for j, z in zip(chosen, forces, strict=True):
            a = [_sum(a[i], [self.response[j][i] * c for c in z]) for i in range(self.n)]
        u = tuple(
            [self.u[i], self.v[i], *[c / (k + 1) / (k + 2) for k, c in enumerate(a[i])]]
            for i in range(self.n)
        )
        pushes = tuple((self.pieces[j].wall.name, z) for j, z in zip(chosen, forces, strict=True))
        self.legs.append(Leg(self.t, u, pushes, _is_regular(self.D, numbers)))
        # The pieces of the state that is gone on with: sides of a maximum, and of relays.
        ahead = {p.number: _sum(_combined(p.row, list(u)), p.law.taylor(self.t), -1) for p in self.pieces}
        self.ahead, self.acting = ahead, self._active(lambda p: ahead[p.number])
        self.forces = dict(zip(chosen, forces, strict=True))

    def _complementary(
        self, numbers: list[int], second: dict[int, Polynomial]
    ) -> tuple[tuple[int, ...], list[Polynomial]]:
        """0 <= z ⊥ w >= 0 coefficient by coefficient, w = D z + second."""
        for count in range(len(numbers) + 1):
            for chosen in itertools.combinations(numbers, count):
                z = self._forces(chosen, second)
                if z is None or any(_sign(p) < 0 for p in z):
                    continue
                others = [j for j in numbers if j not in chosen]
                if all(_sign(self._opening(j, chosen, z, second)) >= 0 for j in others):
                    return chosen, z
        raise Undecided("no forces of contacts")

    def _forces(self, chosen: tuple[int, ...], second: dict[int, Polynomial]) -> list[Polynomial] | None:
        if not chosen:
            return []
        if not _is_regular(self.D, chosen):
            return None
        degree = max(len(second[j]) for j in chosen)
        columns = [
            _solved(self.D, chosen, [-(second[j] + [MP.zero] * degree)[k] for j in chosen])
            for k in range(degree)
        ]
        return [[column[i] for column in columns] for i in range(len(chosen))]

    def _opening(
        self, j: int, chosen: tuple[int, ...], z: list[Polynomial], second: dict[int, Polynomial]
    ) -> Polynomial:
        w = second[j]
        for i, p in zip(chosen, z, strict=True):
            w = _sum(w, p, self.D[j][i])
        return w

    # From one instant to the next

    def advance(self) -> None:
        limit = next((s for s in self.switches if s > self.t + ZERO), self.end)
        wait, what = min(limit, self.end) - self.t, ""
        for piece in self.acting:
            if piece.number not in self.closed:
                wait, what = _first(self.ahead[piece.number], wait, what, "gap")
        for p in self.forces.values():
            wait, what = _first(p, wait, what, "force")
        for wall in self.system.walls:
            if wall.joined == "max" and len(wall.pieces) > 1:
                numbers = [p.number for p in self.pieces if p.wall is wall]
                for i, j in itertools.combinations(numbers, 2):
                    wait, what = _first(_sum(self.ahead[i], self.ahead[j], -1), wait, what, "side", True)
        leg = self.legs[-1]
        for relay in self.system.relays:
            beside = _sum(leg.u[relay.of], [MP.mpf(relay.value)], -1)
            wait, what = _first(beside, wait, what, "relay", True)
        self.u, self.v = [_at(p, wait) for p in leg.u], [_at(_slope(p), wait) for p in leg.u]
        self.t += wait
        if self.t >= self.end:
            return
        closed = self.closed
        self._impacts()
        self._decide()
        # Contacts that opened without an impact.
        left = [self.pieces[j].wall.name for j in closed if j not in self.closed]
        if left and not (self.happenings and self.happenings[-1].t == float(self.t)):
            self._tell("release", tuple(left), self.v)

    def _tell(self, kind: str, walls: tuple[str, ...], before: Vector) -> None:
        v = [tuple(float(c) for c in part) for part in (before, self.v)]
        self.happenings.append(Happening(float(self.t), kind, walls, *v))

    def _impacts(self) -> None:
        """The impact at this instant, if there is one."""
        gaps = {p.number: self._gap(p) for p in self.pieces}
        for p in self._active(lambda p: gaps[p.number]):
            if gaps[p.number][0] < -ZERO * 1000:
                raise Undecided("a wall jumps onto the wrong side")
        near = [p for p in self.pieces if abs(gaps[p.number][0]) <= ZERO]
        acting = self._active(lambda p: gaps[p.number])
        near = [p for p in near if p in acting]
        if not any(gaps[p.number][1] < -ZERO for p in near):
            return
        numbers = [p.number for p in near]
        self._impact(numbers, [MP.mpf(p.wall.e) for p in near], gaps)
        self.recent.append((self.t, numbers))
        if self._is_crowded() or self._is_merged([gaps[j][1] for j in numbers]):
            self._end_series()

    def _is_crowded(self) -> bool:
        struck = [j for t, numbers in self.recent if self.t - t < CROWDED for j in numbers]
        return any(struck.count(j) > 2 for j in self.recent[-1][1])

    def _is_merged(self, speeds: Vector) -> bool:
        """True where contacts that were struck in turn meet at once, for their speeds fall faster than their times: an
        impact of all of them would leave one a speed, small as it is."""
        struck, numbers = [j for _, each in self.recent for j in each], self.recent[-1][1]
        return len(numbers) > 1 and max(map(abs, speeds)) < NEAR and all(struck.count(j) > 2 for j in numbers)

    def _impact(self, numbers: list[int], e: list[Number], gaps: dict[int, Polynomial]) -> None:
        c = {j: [gaps[j][1] + r * min(gaps[j][1], MP.zero)] for j, r in zip(numbers, e, strict=True)}
        chosen, impulses = self._complementary(numbers, c)
        before = self.v
        for j, (P,) in zip(chosen, impulses, strict=True):
            self.v = [a + P * b for a, b in zip(self.v, self.response[j], strict=True)]
        if all(len(p.law.bends) == 0 and len(p.law.powers) < 2 for p in self.pieces):
            energy = [
                sum(MP.mpf(m) * a * a for m, a in zip(self.system.masses, v, strict=True))
                for v in (before, self.v)
            ]
            if energy[1] > energy[0] * (1 + ZERO):
                raise Undecided("the law of impact creates energy")
        self._tell("impact", tuple(self.pieces[j].wall.name for j in chosen), before)

    def _end_series(self) -> None:
        """The limit of impacts that crowd: their contacts close, with relative velocities zero."""
        gaps = {p.number: self._gap(p) for p in self.pieces}
        struck = {j for t, numbers in self.recent if t > self.t - LATELY for j in numbers}
        if any(MP.mpf(self.pieces[j].wall.e) == 1 for j in struck):
            raise Undecided("impacts crowd without end")
        independent: list[int] = []
        for j in sorted(struck):
            if abs(gaps[j][0]) < NEAR and _is_regular(self.D, [*independent, j]):
                independent.append(j)
        before = self.v
        for order, part in enumerate(("u", "v")):
            shifts = _solved(self.D, independent, [-gaps[j][order] for j in independent])
            for j, shift in zip(independent, shifts, strict=True):
                ahead = zip(getattr(self, part), self.response[j], strict=True)
                setattr(self, part, [a + shift * b for a, b in ahead])
        self.recent.clear()
        self._tell("end", tuple(self.pieces[j].wall.name for j in sorted(struck)), before)


def _first(p: Polynomial, wait: Number, what: str, name: str, both: bool = False) -> tuple[Number, str]:
    """The sooner of a wait and the first time at which p becomes negative, or in both ways."""
    zeros = _zeros(p, wait)
    if zeros and (both or _sign(p) > 0) and zeros[0] > ZERO:
        return zeros[0], name
    return wait, what


def _inner(a: Sequence[Number], b: Sequence[Number]) -> Number:
    return sum((x * y for x, y in zip(a, b, strict=True)), MP.zero)


def _combined(row: Vector, columns: list[Polynomial]) -> Polynomial:
    found: Polynomial = [MP.zero]
    for c, p in zip(row, columns, strict=True):
        if c:
            found = _sum(found, p, c)
    return found


def _bend(w: Polynomial) -> Polynomial:
    return _slope(_slope(w)) if w else [MP.zero]


def _is_regular(D: list[Vector], numbers: Sequence[int]) -> bool:
    """True if the rows are independent: no pivot is zero."""
    rows = [[D[i][j] for j in numbers] for i in numbers]
    for k in range(len(rows)):
        if rows[k][k] <= MP.mpf(10) ** -25 * D[numbers[k]][numbers[k]]:
            return False
        for i in range(k + 1, len(rows)):
            times = rows[i][k] / rows[k][k]
            rows[i] = [a - times * b for a, b in zip(rows[i], rows[k], strict=True)]
    return True


def _solved(D: list[Vector], numbers: Sequence[int], right: Vector) -> Vector:
    """x with D x = right on these numbers, which is positive definite."""
    count = len(numbers)
    rows = [[*(D[i][j] for j in numbers), b] for i, b in zip(numbers, right, strict=True)]
    for k in range(count):
        for i in range(k + 1, count):
            times = rows[i][k] / rows[k][k]
            rows[i] = [a - times * b for a, b in zip(rows[i], rows[k], strict=True)]
    x: Vector = [MP.zero] * count
    for k in reversed(range(count)):
        x[k] = (rows[k][-1] - sum((rows[k][j] * x[j] for j in range(k + 1, count)), MP.zero)) / rows[k][k]
    return x
