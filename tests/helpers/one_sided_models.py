"""Random models of point masses with one-sided constraints, as texts and as functions written by hand.

A `Scene` is what both sides share: `text()` is for lagcli, `gap`, `slope` and `bend` of its contacts are for the
checks, which know nothing of lagcli.
"""

from __future__ import annotations

import dataclasses
import json
from collections.abc import Callable

import numpy as np
import numpy.typing as npt

Floats = npt.NDArray[np.float64]
ZERO = (0.0, 0.0, 0.0)


@dataclasses.dataclass(frozen=True, slots=True)
class Contact:
    """g >= 0 of one or two particles.

    A `plane` is n.x - size - speed t - half t**2 - A sin(w t); every other kind is |u| against `size`, where u is
    x - centre or x_j - x_i; `inward` is |u| <= size (a ropes, a round wall). `squared` writes u.u against size**2.
    """

    name: str
    of: tuple[int, ...]
    size: float
    e: float = 0.0
    normal: tuple[float, float, float] | None = None
    centre: tuple[float, float, float] = ZERO
    inward: bool = False
    squared: bool = False
    move: tuple[float, float] = (0.0, 0.0)
    swing: tuple[float, float] = (0.0, 0.0)

    def arm(self, x: Floats) -> Floats:
        """The vector u (3,) of positions x (n, 3)."""
        return x[self.of[1]] - x[self.of[0]] if len(self.of) == 2 else x[self.of[0]] - self.centre

    def gap(self, t: float, x: Floats) -> float:
        """The number g, as it is written."""
        if self.normal is not None:
            (speed, half), (size, w) = self.move, self.swing
            wall = self.size + speed * t + half * t * t + size * np.sin(w * t)
            return float(self.normal @ x[self.of[0]] - wall)
        u = self.arm(x)
        off = u @ u - self.size**2 if self.squared else np.sqrt(u @ u) - self.size
        return float(-off if self.inward else off)

    def slope(self, t: float, x: Floats) -> tuple[Floats, float]:
        """The gradient (n, 3) of g and its partial derivative by t."""
        G = np.zeros_like(x)
        if self.normal is not None:
            (speed, half), (size, w) = self.move, self.swing
            G[self.of[0]] = self.normal
            return G, -(speed + 2 * half * t + size * w * np.cos(w * t))
        u = self.arm(x)
        row = (2 * u if self.squared else u / np.sqrt(u @ u)) * (-1 if self.inward else 1)
        G[self.of[-1]] = row
        if len(self.of) == 2:
            G[self.of[0]] = -row
        return G, 0.0

    def bend(self, t: float, x: Floats, v: Floats) -> float:
        """The part of d2g/dt2 without accelerations."""
        if self.normal is not None:
            size, w = self.swing
            return -2 * self.move[1] + size * w * w * float(np.sin(w * t))
        u = self.arm(x)
        du = v[self.of[1]] - v[self.of[0]] if len(self.of) == 2 else v[self.of[0]]
        r = np.sqrt(u @ u)
        found = 2 * du @ du if self.squared else (du @ du - (u @ du / r) ** 2) / r
        return float(-found if self.inward else found)

    def law(self) -> str:
        """The condition, as a model file has it."""
        if self.normal is not None:
            (speed, half), (size, w) = self.move, self.swing
            left = " + ".join(
                f"({n!r})*p{self.of[0]}.{a}" for n, a in zip(self.normal, "xyz", strict=True) if n
            )
            wall = f"{self.size!r}"
            wall += f" + ({speed!r})*t" if speed else ""
            wall += f" + ({half!r})*t**2" if half else ""
            wall += f" + ({size!r})*sin({w!r}*t)" if size else ""
            return f"{left} >= {wall}"
        one = f"p{self.of[0]}"
        other = f"p{self.of[1]}" if len(self.of) == 2 else json.dumps(list(self.centre))
        sign = "<=" if self.inward else ">="
        if self.squared:
            return f"dot({other} - {one}, {other} - {one}) {sign} {self.size!r}**2"
        return f"distance({one}, {other}) {sign} {self.size!r}"


@dataclasses.dataclass(frozen=True, slots=True)
class Scene:
    """Masses (n,), positions and velocities (n, 3) at t = 0, weight per mass, contacts, rods, and how long it lasts."""

    kind: str
    m: Floats
    x: Floats
    v: Floats
    weight: Floats
    contacts: tuple[Contact, ...]
    rods: tuple[tuple[int, int], ...] = ()
    duration: float = 1.0

    @property
    def lengths(self) -> list[float]:
        return [float(np.linalg.norm(self.x[j] - self.x[i])) for i, j in self.rods]

    @property
    def moves(self) -> bool:
        """Some wall moves, and so energy may come in."""
        return any(any(c.move) or c.swing[0] for c in self.contacts)

    def text(self) -> str:
        """The model file."""
        lines = ["lagcli: 1", f"title: {self.kind}", "particles:"]
        for i, (m, x, v) in enumerate(zip(self.m, self.x, self.v, strict=True)):
            lines.append(f"  p{i}: {{mass: {float(m)!r}, position: {x.tolist()}, velocity: {v.tolist()}}}")
        if self.weight.any():
            force = [f"({w!r})*m" for w in self.weight.tolist()]
            lines += ["forces:", f"  weight: {{to: all, force: {json.dumps(force)}}}"]
        if self.rods:
            lines.append("holonomic:")
        for k, ((i, j), length) in enumerate(zip(self.rods, self.lengths, strict=True)):
            lines.append(f"  rod{k}: distance(p{i}, p{j}) = {length!r}")
        lines.append("inequality:")
        for c in self.contacts:
            lines.append(f"  {c.name}: {{condition: {json.dumps(c.law())}, restitution: {c.e!r}}}")
        return "\n".join(lines) + f"\nsimulation: {{duration: {self.duration!r}, samples: 41}}\n"


def polygon(random: np.random.Generator, sides: int, size: float) -> list[tuple[float, float, float]]:
    """Inward normals of a convex polygon about the origin, in the plane of x and z."""
    turns = 2 * np.pi * (np.arange(sides) + random.uniform(-0.3, 0.3, sides)) / sides + random.uniform(0, 7)
    return [(float(np.cos(a)), 0.0, float(np.sin(a))) for a in turns]


def _walls(
    random: np.random.Generator, count: int, radius: float, flat: bool, e: Callable[[], float]
) -> list[Contact]:
    if flat:
        normals = polygon(random, int(random.integers(3, 7)), 1.0)
    else:
        normals = [tuple(float(s * (k == a)) for k in range(3)) for a in range(3) for s in (1, -1)]
    return [
        Contact(f"w{k}_{i}", (i,), radius - 1.0, e(), normal)
        for k, normal in enumerate(normals)
        for i in range(count)
    ]


def _places(random: np.random.Generator, count: int, radius: float, flat: bool, hole: float) -> Floats:
    """Places well inside that do not overlap, nor the hole in the middle."""
    found: list[Floats] = []
    while len(found) < count:
        x = random.uniform(-0.75, 0.75, 3) * (1, 0 if flat else 1, 1)
        r = np.linalg.norm(x)
        if hole + 0.02 < r < 0.85 - radius and all(np.linalg.norm(x - o) > 2 * radius + 0.02 for o in found):
            found.append(x)
    return np.array(found)


def scene(seed: int) -> Scene:
    """A random scene; the same for the same seed."""
    random = np.random.default_rng([14, seed])
    kind = str(random.choice(["balls", "round", "ropes", "moving", "dumbbells", "frames"]))
    flat = bool(random.random() < 0.6)
    count = (
        int(random.integers(2, 4)) if kind in ("dumbbells", "frames", "ropes") else int(random.integers(1, 4))
    )
    common = float(random.choice([0.0, 1.0, random.uniform(0, 1), random.uniform(0.3, 1)]))
    radius = float(random.uniform(0.05, 0.15)) if count > 1 else 0.0
    hole = float(random.uniform(0.1, 0.25)) if kind == "round" else 0.0
    squared = bool(random.random() < 0.3)
    mixed = bool(random.random() < 0.15)

    def e() -> float:
        return float(random.uniform(0, 1)) if mixed else common

    x = _places(random, count, radius, flat, hole + radius)
    v = random.normal(0, 1.5, (count, 3)) * (1, 0 if flat else 1, 1)
    weight = np.zeros(3) if random.random() < 0.35 else np.array([0.0, 0.0, -float(random.uniform(1, 10))])
    contacts = _walls(random, count, radius, flat, e)
    rods: tuple[tuple[int, int], ...] = ()
    pairs = [(i, j) for i in range(count) for j in range(i)]
    if kind == "round":
        contacts += [Contact(f"hole_{i}", (i,), hole + radius, e(), squared=squared) for i in range(count)]
    if kind == "ropes":
        lengths = [float(np.linalg.norm(x[i] - x[j])) * random.uniform(1.05, 1.5) for i, j in pairs]
        contacts += [
            Contact(f"rope_{i}_{j}", (i, j), float(d), e(), inward=True, squared=squared)
            for (i, j), d in zip(pairs, lengths, strict=True)
        ]
    if kind == "moving":
        contacts = [dataclasses.replace(c, **_drive(random)) for c in contacts]
    if kind in ("dumbbells", "frames"):
        rods = tuple(pairs[: 1 if kind == "dumbbells" else len(pairs)])
        v = _rigid(random, x, flat) if kind == "frames" else _free_rod(v, x, rods)
    free = [pair for pair in pairs if pair not in rods]
    if radius and kind != "ropes":
        contacts += [Contact(f"c_{i}_{j}", (i, j), 2 * radius, e(), squared=squared) for i, j in free]
    order = random.permutation(len(contacts))
    m = np.exp(random.normal(0, 0.5, count))
    duration = float(random.uniform(1, 3))
    return Scene(kind, m, x, v, weight, tuple(contacts[k] for k in order), rods, duration)


def _drive(random: np.random.Generator) -> dict[str, tuple[float, float]]:
    """A motion of a wall; they stay clear of the middle."""
    match int(random.integers(0, 4)):
        case 0:
            return {"move": (float(random.uniform(-0.3, 0.05)), 0.0)}
        case 1:
            return {"move": (0.0, float(random.uniform(-0.2, 0.01)))}
        case 2:
            return {"swing": (float(random.uniform(0.01, 0.1)), float(random.uniform(2, 15)))}
    return {}


def _free_rod(v: Floats, x: Floats, rods: tuple[tuple[int, int], ...]) -> Floats:
    """Velocities without the stretching of the first rod."""
    i, j = rods[0]
    u = (x[j] - x[i]) / np.linalg.norm(x[j] - x[i])
    v = v.copy()
    v[j] -= ((v[j] - v[i]) @ u) * u
    return v


def _rigid(random: np.random.Generator, x: Floats, flat: bool) -> Floats:
    """Velocities of a rigid body."""
    turn = random.normal(0, 3, 3) * ((0, 1, 0) if flat else (1, 1, 1))
    return random.normal(0, 1, 3) * (1, 0 if flat else 1, 1) + np.cross(turn, x)
