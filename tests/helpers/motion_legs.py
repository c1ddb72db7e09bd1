"""A run of a `Scene` judged piece by piece: each leg integrated again, each impact against the law of the theory.

Every leg starts from the state that the run itself has, so that what is chaotic does not grow into the verdict. No
function of lagcli is used; masses are free points, with rods and contacts as rows.
"""

from __future__ import annotations

import dataclasses
import itertools
from collections.abc import Iterator

import numpy as np
from scipy import integrate

from tests.helpers.free_flight import complementary
from tests.helpers.one_sided_models import Contact, Floats, Scene

STILL = 1e-8  # a gap or a rate that counts as zero
CLOSED, MOST_OFF = 1e-11, 3  # a gap that is closed for certain, and how many that may be open are looked at
TOUCH = 1e-14  # a gap that must take part in an impact
TOLERANCE = 1e-6
LAST = 1e-4  # of an impact that stands for the rest of a series of rebounds
PENETRATION = 1e-8
# A rise that doubles of numbers about 1 do not tell from none: speeds up to that of such a rise may be dropped.
UNSEEN = 2e-13


@dataclasses.dataclass(frozen=True, slots=True)
class Instant:
    """What happened at a time: kinds with names, impulses by row, x and v (n, 3) before and after."""

    t: float
    kinds: tuple[tuple[str, str], ...]
    impulses: dict[str, float]
    x: Floats
    before: Floats
    after: Floats

    def names(self, kind: str) -> set[str]:
        return {name for each, name in self.kinds if each == kind}


@dataclasses.dataclass(frozen=True, slots=True)
class Recorded:
    """A run: instants, and rows (t, x, v) with the multipliers of the rows by name and the energy."""

    instants: list[Instant]
    t: Floats
    x: Floats
    v: Floats
    multipliers: dict[str, Floats]
    energy: Floats


class Rows:
    """Newton's equations of a scene at one state, with rods and some contacts held."""

    def __init__(self, scene: Scene, t: float, x: Floats, v: Floats) -> None:
        self.scene, self.t, self.x, self.v = scene, t, x, v
        self.W = np.repeat(1 / scene.m, 3)
        self.force = (scene.m[:, None] * scene.weight).ravel()

    def rods(self) -> tuple[Floats, Floats]:
        """The rows (k, 3 n) of the rods, and the terms of their second derivatives without accelerations."""
        rows, bends = np.zeros((len(self.scene.rods), self.x.size)), np.zeros(len(self.scene.rods))
        for k, (i, j) in enumerate(self.scene.rods):
            rod = Contact("", (i, j), 0.0)
            rows[k] = rod.slope(self.t, self.x)[0].ravel()
            bends[k] = rod.bend(self.t, self.x, self.v)
        return rows, bends

    def contacts(self, chosen: list[Contact]) -> tuple[Floats, Floats, Floats]:
        """Rows, bends and rates of contacts."""
        slopes = [c.slope(self.t, self.x) for c in chosen]
        rows = np.array([G.ravel() for G, _ in slopes]).reshape(-1, self.x.size)
        bends = np.array([c.bend(self.t, self.x, self.v) for c in chosen])
        return rows, bends, rows @ self.v.ravel() + np.array([g_t for _, g_t in slopes])

    def inverse(self) -> tuple[Floats, Floats]:
        """M**-1 on the tangent space of the rods (3 n, 3 n), and the accelerations of the rods alone."""
        rows, bends = self.rods()
        P = np.diag(self.W)
        free = self.W * self.force
        if len(rows):
            lift = (rows * self.W).T @ np.linalg.pinv((rows * self.W) @ rows.T, rcond=1e-11)
            P = P - lift @ (rows * self.W)
            free = free - lift @ (rows @ free + bends)
        return P, free

    def held(self, contacts: list[Contact]) -> tuple[Floats, Floats]:
        """Accelerations (3 n,) and multipliers of contacts that stay closed."""
        P, free = self.inverse()
        rows, bends, _ = self.contacts(contacts)
        lam = -np.linalg.lstsq(rows @ P @ rows.T, rows @ free + bends, rcond=1e-11)[0]
        return free + P @ rows.T @ lam, lam

    def settled(self, contacts: list[Contact]) -> Floats:
        """Velocities (n, 3) without the rates of contacts."""
        P, _ = self.inverse()
        rows, _, rates = self.contacts(contacts)
        push = np.linalg.lstsq(rows @ P @ rows.T, rates, rcond=1e-11)[0]
        return self.v - (P @ rows.T @ push).reshape(self.v.shape)

    def choices(self) -> list[list[Contact]]:
        """The sets of contacts that may be closed from now on: one, or several where a multiplier is zero."""
        near = [c for c in self.scene.contacts if abs(c.gap(self.t, self.x)) < STILL]
        still = [c for c in near if abs(self.contacts([c])[2][0]) < STILL]
        if not still:
            return [[]]
        # One that is a little off may fall yet, which is not to be told from lying by STILL.
        off = [each for each in still if abs(each.gap(self.t, self.x)) > CLOSED][:MOST_OFF]
        sets = itertools.chain.from_iterable(
            itertools.combinations(off, size) for size in range(len(off) + 1)
        )
        found: list[list[Contact]] = []
        for left_out in sets:
            more = self._choices([each for each in still if each not in left_out])
            found += [each for each in more if each not in found]
        return found

    def _choices(self, still: list[Contact]) -> list[list[Contact]]:
        if not still:
            return [[]]
        P, free = self.inverse()
        rows, bends, _ = self.contacts(still)
        D, c = rows @ P @ rows.T, rows @ free + bends
        lam = complementary(D, c)
        if lam is None:
            return [[], still]
        w = D @ lam + c
        small = 1e-5 * (1 + np.abs(c).max())
        sure = [each for each, z, _ in zip(still, lam, w, strict=True) if z > small]
        doubt = [each for each, z, g in zip(still, lam, w, strict=True) if z <= small and g <= small]
        return [
            sure + list(more)
            for size in range(min(len(doubt), 5) + 1)
            for more in itertools.combinations(doubt, size)
        ]


def faults(scene: Scene, run: Recorded) -> list[str]:
    """What is wrong with a run; nothing where all is right."""
    return [*_rows(scene, run), *_energy(scene, run), *_impacts(scene, run), *_legs(scene, run)]


def _rows(scene: Scene, run: Recorded) -> Iterator[str]:
    for k, t in enumerate(run.t):
        for c in scene.contacts:
            g, lam = c.gap(t, run.x[k]), run.multipliers[c.name][k]
            if g < -PENETRATION:
                yield f"penetration {c.name} {g:.1e} at t = {t!r}"
            if lam < -PENETRATION * (1 + abs(scene.weight).max()):
                yield f"pull lambda.{c.name} {lam:.1e} at t = {t!r}"
            if abs(lam * g) > TOLERANCE * (1 + abs(lam)):
                yield f"lambda g {c.name}: {lam:.1e} {g:.1e} at t = {t!r}"


def _energy(scene: Scene, run: Recorded) -> Iterator[str]:
    if scene.moves:
        return
    growth = np.diff(run.energy)
    worst = int(growth.argmax())
    if growth[worst] > PENETRATION * (1 + np.abs(run.energy).max()):
        yield f"energy grows by {growth[worst]:.1e} before t = {run.t[worst + 1]!r}"


def _impacts(scene: Scene, run: Recorded) -> Iterator[str]:
    for k, at in enumerate(run.instants):
        if not at.names("impact"):
            if not at.names("accumulation") and np.abs(at.after - at.before).max() > TOLERANCE:
                yield f"velocities jump without an impact at t = {at.t!r}"
            continue
        ends = [o for o in run.instants if o.names("accumulation") & at.names("impact")]
        lax = LAST if any(at.t < o.t < at.t + LAST for o in ends) else TOLERANCE
        # Contacts that are struck a moment later, at the same time to rounding.
        later = {name for o in run.instants[k + 1 :] if o.t == at.t for name in o.names("impact")}
        yield from (f"impact at t = {at.t!r}: {text}" for text in _impact(scene, at, lax, later))


def _impact(scene: Scene, at: Instant, lax: float, later: set[str]) -> Iterator[str]:
    size = 1 + np.abs(at.before).max()
    before, after = Rows(scene, at.t, at.x, at.before), Rows(scene, at.t, at.x, at.after)
    rods, _ = before.rods()
    gaps = {c: abs(c.gap(at.t, at.x)) for c in scene.contacts}
    meant = {name for name, P in at.impulses.items() if P} | at.names("impact")
    near = [
        c
        for c, gap in gaps.items()
        if gap < (STILL if c.name in meant else TOUCH if c.name not in later else 0)
    ]
    rows, _, came = before.contacts(near)
    _, _, left = after.contacts(near)
    P = np.array([at.impulses.get(c.name, 0.0) for c in near])
    Q = np.array([at.impulses.get(f"rod{k}", 0.0) for k in range(len(scene.rods))])
    jump = (scene.m[:, None] * (at.after - at.before)).ravel()
    dropped = scene.m.max() * np.sqrt(2 * UNSEEN * (1 + np.abs(scene.weight).max()))
    if np.abs(jump - rows.T @ P - rods.T @ Q).max() > TOLERANCE * size + dropped:
        yield f"momenta against impulses {np.abs(jump - rows.T @ P - rods.T @ Q).max():.1e}"
    if len(rods) and np.abs(rods @ at.after.ravel()).max() > TOLERANCE * size:
        yield "a rod stretches"
    wanted = left + np.array([c.e for c in near]) * np.minimum(came, 0)
    if (-TOLERANCE * size > P).any() or (wanted < -lax * size).any():
        yield f"impulse {P.min():.1e}, u+ + e u- {wanted.min():.1e}"
    if (np.abs(P * wanted) > lax * size**2).any():
        yield f"impulse times (u+ + e u-) {np.abs(P * wanted).max():.1e}"
    for name in at.names("impact") - {c.name for c in near}:
        yield f"{name} is open"
    energy = [float((scene.m[:, None] * v**2).sum() / 2) for v in (at.before, at.after)]
    if not scene.moves and energy[1] > energy[0] + TOLERANCE * size**2:
        yield f"energy {energy[0]!r} to {energy[1]!r}"


def _legs(scene: Scene, run: Recorded) -> Iterator[str]:
    t, x, v = run.t[0], run.x[0], run.v[0]
    marks = [(at.t, at.x, at.before, at) for at in run.instants]
    for end, goal, speed, at in [*marks, (run.t[-1], run.x[-1], run.v[-1], None)]:
        # On the short way to the end of a series of rebounds those that are left out are missing.
        if end > t and not (at is not None and at.names("accumulation")):
            found = [
                _leg(scene, (t, x, begun), held, (end, goal, speed))
                for begun in (v, *_without_rebounds(scene, run, (t, x, v), end))
                for held in Rows(scene, t, x, begun).choices()
            ]
            if all(found):
                yield f"leg {t!r} to {end!r}: {min(found, key=len)}"
        if at is not None:
            t, x, v = end, goal, at.after


def _without_rebounds(
    scene: Scene, run: Recorded, start: tuple[float, Floats, Floats], end: float
) -> list[Floats]:
    """The velocities of a leg in which contacts lie whose series of rebounds is told to end a little after it."""
    t, x, v = start
    names = {n for o in run.instants if end < o.t < t + LAST for n in o.names("accumulation")}
    lying = [c for c in scene.contacts if c.name in names and abs(c.gap(t, x)) < STILL]
    here = Rows(scene, t, x, v)
    slow = [c for c in lying if 0 < here.contacts([c])[2][0] < LAST]
    sets = (chosen for k in range(1, len(slow) + 1) for chosen in itertools.combinations(slow, k))
    return [here.settled(list(chosen)) for chosen in sets]


def _leg(
    scene: Scene, start: tuple[float, Floats, Floats], held: list[Contact], end: tuple[float, Floats, Floats]
) -> str:
    """What is wrong between two states where these contacts stay closed; nothing where all is right."""
    (began, x, v), (until, goal, speed) = start, end
    n = x.size

    def rate(t: float, y: Floats) -> Floats:
        a, _ = Rows(scene, t, y[:n].reshape(-1, 3), y[n:].reshape(-1, 3)).held(held)
        return np.concatenate([y[n:], a])

    y0 = np.concatenate([x.ravel(), v.ravel()])
    times = np.linspace(began, until, 33)
    if held or scene.rods:
        made = integrate.solve_ivp(rate, (began, until), y0, "DOP853", times, rtol=1e-10, atol=1e-12)
        if not made.success:
            return "cannot be integrated"
        states = made.y.T
    else:
        s = (times - began)[:, None, None]
        places = x + s * v + s * s / 2 * scene.weight
        states = np.concatenate([places.reshape(33, -1), (v + s * scene.weight).reshape(33, -1)], axis=1)
    off = states[-1] - np.concatenate([goal.ravel(), speed.ravel()])
    if np.abs(off).max() > TOLERANCE * (1 + np.abs(y0).max()):
        return f"ends elsewhere, by {np.abs(off).max():.1e} ({', '.join(c.name for c in held)} closed)"
    for t, y in zip(times, states, strict=True):
        place, swift = y[:n].reshape(-1, 3), y[n:].reshape(-1, 3)
        for c in scene.contacts:
            if c.gap(t, place) < -10 * PENETRATION:
                return f"{c.name} is {c.gap(t, place):.1e} at t = {t!r}"
        if held:
            _, lam = Rows(scene, t, place, swift).held(held)
            if lam.min() < -1e-5 * (1 + np.abs(scene.weight).max()):
                return f"{held[int(lam.argmin())].name} pulls with {lam.min():.1e} at t = {t!r}"
    return ""
