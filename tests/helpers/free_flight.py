"""Impacts of point masses between flights along parabolas, by roots of polynomials: a second way to a `Scene`.

Gaps of planes are polynomials of degree 2 in time, those of spheres and ropes (squared) of degree 4; a mass that
rests on planes moves along a parabola too. Where it would go on along a curved contact the answer ends (`until`).
"""

from __future__ import annotations

import dataclasses
import itertools

import numpy as np

from tests.helpers.one_sided_models import Contact, Floats, Scene

CLOSED = 1e-9  # a gap, or its rate, that counts as zero
AT_ZERO = 1e-12  # a gap from which nothing comes back to zero later: it is zero now
DOUBTFUL = 1e-11  # a gap that a run, to its accuracy, may take for zero in an impact of another contact
SMALL = 1e-7  # a speed of rebound from which the series of rebounds is summed


@dataclasses.dataclass(frozen=True, slots=True)
class Blow:
    """An impact: when, the contacts that took part with their impulses (of g as it is written)."""

    t: float
    impulses: dict[str, float]


@dataclasses.dataclass(frozen=True, slots=True)
class Answer:
    """Impacts, ends of series of rebounds, and the legs (t, x, v, a) from each instant to the next."""

    blows: list[Blow]
    rests: list[tuple[float, str]]
    legs: list[tuple[float, Floats, Floats, Floats]]
    until: float
    why: str

    def at(self, t: float) -> tuple[Floats, Floats]:
        """Positions and velocities (n, 3) at t, after an impact at that instant."""
        began, x, v, a = [leg for leg in self.legs if leg[0] <= t][-1]
        s = t - began
        return x + s * v + s * s / 2 * a, v + s * a


def complementary(D: Floats, c: Floats) -> Floats | None:
    """The z >= 0 with w = D z + c >= 0 and z w = 0, by trying all sets; of least size where there are several."""
    found = []
    scale = 1e-9 * (1 + np.abs(c).max(initial=0))
    for chosen in itertools.product((False, True), repeat=len(c)):
        on = np.array(chosen, dtype=bool)
        z = np.zeros(len(c))
        z[on] = -np.linalg.lstsq(D[np.ix_(on, on)], c[on], rcond=None)[0]
        w = D @ z + c
        if (z >= -scale).all() and (w >= -scale).all() and np.abs(w[on]).max(initial=0) <= scale:
            found.append(z)
    return min(found, key=lambda z: float(z @ z)) if found else None


def solve(scene: Scene, most: int = 400) -> Answer:
    """The motion of a scene of free masses, up to its end or to where this method ends."""
    flight = _Flight(scene)
    while flight.t < scene.duration and not flight.why and len(flight.blows) < most:
        flight.advance()
    return Answer(flight.blows, flight.rests, flight.legs, flight.t, flight.why)


class _Flight:
    def __init__(self, scene: Scene) -> None:
        assert not scene.rods
        self.scene, self.t = scene, 0.0
        self.x, self.v = scene.x.copy(), scene.v.copy()
        self.blows: list[Blow] = []
        self.rests: list[tuple[float, str]] = []
        self.legs: list[tuple[float, Floats, Floats, Floats]] = []
        self.why = (
            "" if not any(c.swing[0] for c in scene.contacts) else "a wall that swings is no polynomial"
        )
        self.held: tuple[Contact, ...] = ()
        self.a = self._accelerations()
        self._keep()

    def _keep(self) -> None:
        self.legs.append((self.t, self.x, self.v, self.a))

    def _rate(self, c: Contact) -> float:
        G, g_t = c.slope(self.t, self.x)
        return float((G * self.v).sum() + g_t)

    def _accelerations(self) -> Floats:
        """(n, 3), with the contacts that are held; these are found anew."""
        free = np.tile(self.scene.weight, (len(self.scene.m), 1))
        near = [c for c in self.scene.contacts if abs(c.gap(self.t, self.x)) < CLOSED]
        still = [c for c in near if abs(self._rate(c)) < CLOSED]
        if not still:
            self.held = ()
            return free
        rows = np.array([c.slope(self.t, self.x)[0].ravel() for c in still])
        scaled = rows / np.repeat(self.scene.m, 3)
        bends = np.array([c.bend(self.t, self.x, self.v) for c in still])
        lam = complementary(scaled @ rows.T, scaled @ (free * self.scene.m[:, None]).ravel() + bends)
        if lam is None:
            self.why = "no solution of the accelerations"
            return free
        self.held = tuple(c for c, push in zip(still, lam, strict=True) if push > 0)
        if any(c.normal is None for c in still):
            self.why = "a contact along a curve"
        return free + (scaled.T @ lam).reshape(-1, 3)

    def _polynomial(self, c: Contact) -> Floats:
        """Coefficients of g (squared where it is round), constant first, of the time from now."""
        x, v, a, t = self.x, self.v, self.a, self.t
        if c.normal is not None:
            i, (speed, half) = c.of[0], c.move
            n = np.asarray(c.normal)
            return np.array([c.gap(t, x), n @ v[i] - speed - 2 * half * t, n @ a[i] / 2 - half])
        u = c.arm(x)
        i, j = c.of if len(c.of) == 2 else (None, c.of[0])
        du, dd = (v[j], a[j] / 2) if i is None else (v[j] - v[i], (a[j] - a[i]) / 2)
        found = [u @ u - c.size**2, 2 * u @ du, du @ du + 2 * u @ dd, 2 * du @ dd, dd @ dd]
        return np.array(found) * (-1 if c.inward else 1)

    def _next(self, c: Contact) -> float:
        """Time until g would become negative."""
        p = self._polynomial(c)
        if c in self.held:
            return np.inf
        if abs(c.gap(self.t, self.x)) < AT_ZERO:
            p = p[1:]
            if abs(self._rate(c)) < CLOSED:
                p = p[1:]
        roots = np.roots(np.trim_zeros(p[::-1], "f"))
        good = sorted(r.real for r in roots if abs(r.imag) < 1e-9 * (1 + abs(r)) and r.real > 1e-13)
        q = np.polynomial.Polynomial(p)
        for s in good:
            for _ in range(3):
                slope = q.deriv()(s)
                s -= q(s) / slope if slope else 0.0
            if q.deriv()(s) < 0:
                return float(s)
        return np.inf

    def advance(self) -> None:
        waits = {c: self._next(c) for c in self.scene.contacts}
        s = min(waits.values())
        if self.t + s >= self.scene.duration:
            self.t = self.scene.duration
            return
        self._go(s)
        meant = [c for c, wait in waits.items() if wait - s < CLOSED]
        self._blow(meant)
        if not self.why:
            self.a = self._accelerations()
            self._keep()
            self._sum_series(meant)

    def _go(self, s: float) -> None:
        self.x = self.x + s * self.v + s * s / 2 * self.a
        self.v = self.v + s * self.a
        self.t += s

    def _blow(self, meant: list[Contact]) -> None:
        near = [c for c in self.scene.contacts if abs(c.gap(self.t, self.x)) < AT_ZERO]
        near += [c for c in meant if c not in near]
        if any(abs(c.gap(self.t, self.x)) < DOUBTFUL for c in self.scene.contacts if c not in near):
            self.why = "impacts that may be one"
            return
        slopes = [c.slope(self.t, self.x) for c in near]
        rows = np.array([G.ravel() for G, _ in slopes])
        u = rows @ self.v.ravel() + np.array([g_t for _, g_t in slopes])
        e = np.array([c.e for c in near])
        scaled = rows / np.repeat(self.scene.m, 3)
        P = complementary(scaled @ rows.T, u + e * np.minimum(u, 0))
        if P is None:
            self.why = "no solution of the impact"
            return
        before = self._energy()
        v = self.v + (scaled.T @ P).reshape(-1, 3)
        self.v = v
        self.blows.append(Blow(self.t, {c.name: float(p) for c, p in zip(near, P, strict=True) if p}))
        if not self.scene.moves and self._energy() > before * (1 + 1e-9):
            self.why = "energy from nowhere"

    @staticmethod
    def _moved(z: Floats, rows: Floats, off: list[float]) -> Floats:
        """The nearest point at which the rows are not off any more."""
        return z - np.linalg.lstsq(rows, np.array(off), rcond=None)[0].reshape(z.shape)

    def _energy(self) -> float:
        return float((self.scene.m * (self.v**2).sum(1)).sum() / 2)

    def _sum_series(self, meant: list[Contact]) -> None:
        """Small rebounds from one plane are summed: t1 (1 + e)/(1 - e), and rest."""
        if len(meant) != 1 or meant[0].normal is None or meant[0].e >= 1:
            return
        (c,) = meant
        up = self._rate(c)
        press = -2 * self._polynomial(c)[2]
        if c in self.held or not CLOSED < up < SMALL or press <= 0:
            return
        s = 2 * up / press / (1 - c.e)
        if any(self._next(o) <= s for o in self.scene.contacts if o is not c):
            self.why = "small rebounds of several"
            return
        self._go(s)
        closed = [c, *self.held]
        rows = np.array([each.slope(self.t, self.x)[0].ravel() for each in closed])
        self.x = self._moved(self.x, rows, [each.gap(self.t, self.x) for each in closed])
        self.v = self._moved(self.v, rows, [self._rate(each) for each in closed])
        self.rests.append((self.t, c.name))
        self.a = self._accelerations()
        self._keep()
