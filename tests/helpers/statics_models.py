"""Random problems of calculus with known solutions, and random mechanisms that come to rest."""

from __future__ import annotations

import dataclasses
import itertools
import math
import random
from collections.abc import Iterator

Solution = tuple[float, ...]


@dataclasses.dataclass(frozen=True)
class Factor:
    """One particle on its surface: rows, its part of the function, and all its stationary places."""

    rows: tuple[str, ...]
    function: str
    places: tuple[Solution, ...]
    start: Solution


@dataclasses.dataclass(frozen=True)
class Problem:
    """A product of surfaces with a sum of functions: its solutions are all combinations."""

    text: str
    of: str
    solutions: tuple[Solution, ...]


def decimal(draw: random.Random, low: float, high: float) -> float:
    return round(draw.uniform(low, high), 2)


def distinct(draw: random.Random, count: int) -> list[float]:
    """Weights that differ clearly and do not vanish."""
    while True:
        found = [decimal(draw, -3, 3) for _ in range(count)]
        pairs = itertools.combinations([0.0, *found], 2)
        if all(abs(a - b) > 0.3 for a, b in pairs):
            return found


def factor(draw: random.Random, name: str) -> Factor:
    kind = draw.choice(("circle linear", "circle quadratic", "plane", "sphere linear", "sphere quadratic"))
    r, height = decimal(draw, 0.5, 2.5), decimal(draw, -1, 1)
    square = f"{r}**2"
    x, y, z = (f"{name}.{axis}" for axis in "xyz")
    start = (decimal(draw, -1, 1), decimal(draw, -1, 1), decimal(draw, -1, 1))
    if kind == "plane":
        a, b, c = (decimal(draw, 0.3, 2) * draw.choice((1, -1)) for _ in "xyz")
        level, centre = decimal(draw, -2, 2), [decimal(draw, -1, 1) for _ in "xyz"]
        weights = [decimal(draw, 0.3, 3) for _ in "xyz"]
        normal = (a, b, c)
        off = level - sum(n * m for n, m in zip(normal, centre, strict=True))
        scale = off / sum(n * n / w for n, w in zip(normal, weights, strict=True))
        place = tuple(m + scale * n / w for m, n, w in zip(centre, normal, weights, strict=True))
        squares = [f"({w})*({u} - ({m}))**2" for w, u, m in zip(weights, (x, y, z), centre, strict=True)]
        return Factor((f"({a})*{x} + ({b})*{y} + ({c})*{z} = {level}",), " + ".join(squares), (place,), start)
    if kind.startswith("circle"):
        rows = (f"{x}**2 + {y}**2 = {square}", f"{z} = {height}")
        if kind.endswith("linear"):
            a, b = distinct(draw, 2)
            size = math.hypot(a, b)
            places = tuple((s * r * a / size, s * r * b / size, height) for s in (1, -1))
            return Factor(rows, f"({a})*{x} + ({b})*{y}", places, start)
        a, b = distinct(draw, 2)
        places = ((r, 0, height), (-r, 0, height), (0, r, height), (0, -r, height))
        return Factor(rows, f"({a})*{x}**2 + ({b})*{y}**2", places, start)
    rows = (f"{x}**2 + {y}**2 + {z}**2 = {square}",)
    weights = distinct(draw, 3)
    if kind.endswith("linear"):
        size = math.sqrt(sum(w * w for w in weights))
        places = tuple(tuple(s * r * w / size for w in weights) for s in (1, -1))
        terms = [f"({w})*{u}" for w, u in zip(weights, (x, y, z), strict=True)]
    else:
        places = tuple(tuple(s * r * (i == k) for i in range(3)) for k in range(3) for s in (1, -1))
        terms = [f"({w})*{u}**2" for w, u in zip(weights, (x, y, z), strict=True)]
    return Factor(rows, " + ".join(terms), places, start)


def problem(seed: int, inexact: bool = False) -> Problem:
    """A problem with up to 48 solutions; `inexact`: its numbers cannot be taken exactly."""
    draw = random.Random(seed)
    while True:
        factors = [factor(draw, f"p{k}") for k in range(draw.randint(1, 3))]
        if math.prod(len(f.places) for f in factors) <= 48:
            break
    lines = ["lagcli: 1", "particles:"]
    lines += [f"  p{k}: {{mass: 1, position: {list(f.start)}}}" for k, f in enumerate(factors)]
    lines.append("holonomic:")
    lines += [f"  r{k}{i}: {row}" for k, f in enumerate(factors) for i, row in enumerate(f.rows)]
    solutions = tuple(
        tuple(x for place in places for x in place)
        for places in itertools.product(*(f.places for f in factors))
    )
    of = " + ".join(f.function for f in factors)
    return Problem("\n".join(lines) + "\n", f"sqrt(2)*({of})" if inexact else of, solutions)


NAMES = ("x", "y", "z", "u")


@dataclasses.dataclass(frozen=True)
class Polynomial:
    """A polynomial `of` n coordinates, with rows = 0 and walls >= 0 that are polynomials."""

    n: int
    of: str
    rows: tuple[str, ...]
    walls: tuple[str, ...]
    start: Solution

    @property
    def text(self) -> str:
        """The model."""
        values = ", ".join(
            f"{name}: {{value: {x}}}" for name, x in zip(NAMES[: self.n], self.start, strict=True)
        )
        lines = ["lagcli: 1", f"coordinates: {{{values}}}", "simulation: {assemble: true}"]
        for part, letter, sense, texts in (
            ("holonomic", "r", "=", self.rows),
            ("inequality", "w", ">=", self.walls),
        ):
            if texts:
                lines += [f"{part}:", *(f"  {letter}{k}: '{text} {sense} 0'" for k, text in enumerate(texts))]
        return "\n".join(lines) + "\n"


def polynomial(seed: int) -> Polynomial:
    """A random one of degree four at the most: some with double zeros, some with coefficients that nearly vanish."""
    draw = random.Random(5000 + seed)
    n = draw.choice((1, 1, 2, 2, 2, 3, 3, 4))
    names = NAMES[:n]
    is_decimal = draw.random() < 0.4

    def number(size: int = 4) -> str:
        value: float = 0
        while not value:
            value = decimal(draw, -size, size) if is_decimal else draw.randint(-size, size)
        if draw.random() < 0.08:
            return f"({value})*10**(-{draw.randint(4, 10)})"
        return f"({value})"

    def monomial(degree: int) -> str:
        return "*".join(draw.choice(names) for _ in range(degree))

    top = {1: 4, 2: 4, 3: 3, 4: 2}[n]
    terms = [f"{number()}*{monomial(draw.randint(1, top))}" for _ in range(draw.randint(2, 4))]
    kind = draw.choice(("plain", "bounded", "square", "flat"))
    if kind == "bounded":
        terms += [f"{name}**{2 if n > 2 else 4}" for name in names]
    elif kind == "square":
        terms = [
            f"({number()}*{draw.choice(names)} + {number()}*{draw.choice(names)}**{top // 2} + {number()})**2"
        ]
        terms += [f"{number()}*{name}**2" for name in names]
    elif kind == "flat":
        terms = [
            f"{number()}*({name} + {number()})**{draw.choice((2, 3) if n > 2 else (2, 3, 4))}"
            for name in names
        ]
    rows = []
    if n > 1 and draw.random() < 0.5:
        squares = " + ".join(f"{draw.choice((1, 1, 2))}*{name}**2" for name in names)
        rows = [
            draw.choice(
                (f"{squares} - {draw.randint(1, 4)}", f"{names[0]} + {number()}*{names[1]} + {number()}")
            )
        ]
    walls = []
    if draw.random() < 0.4:
        wall = f"{draw.choice(names)} + {number(2)}"
        walls = [draw.choice((wall, f"{draw.randint(2, 5)} - {names[0]}**2", f"{names[-1]}"))]
    start = tuple(decimal(draw, -1, 1) for _ in names)
    return Polynomial(n, " + ".join(terms), tuple(rows), tuple(walls), start)


def mechanism(seed: int) -> str:
    """A mechanism with weights, springs, rods, redundant rows and floors that has a place of rest."""
    draw = random.Random(1000 + seed)
    kind = draw.choice(("chain", "pair", "angles", "floor", "net"))
    g, m = decimal(draw, 5, 12), decimal(draw, 0.5, 3)
    head = f"lagcli: 1\nparameters: {{g: {g}, m0: {m}, k: {decimal(draw, 20, 80)}}}\n"
    weight = "forces:\n  weight: {to: all, force: [0, 0, -m*g]}\n  drag: {to: all, force: -0.5*v}\n"
    end = "simulation: {assemble: true, duration: 0.5, samples: 3}\n"
    if kind == "angles":
        a, b = decimal(draw, 0.3, 1.2), decimal(draw, 0.3, 1.2)
        return (
            head
            + (
                f"coordinates:\n  u: {{value: {decimal(draw, -1, 1)}}}\n  w: {{value: {decimal(draw, -1, 1)}}}\n"
                f'particles:\n  a: {{mass: m0, position: "[{a}*sin(u), 0, -{a}*cos(u)]"}}\n'
                f'  b: {{mass: m0/2, position: "a + [{b}*sin(w), 0, -{b}*cos(w)]"}}\n'
                "forces:\n  weight: {to: all, force: [0, 0, -m*g]}\n  spring: {potential: k/50*(u - w)**2}\n"
                f"  push: {{to: u, force: {decimal(draw, -1, 1)}}}\n"
            )
            + end
        )
    if kind == "chain":
        n, span = draw.randint(2, 5), decimal(draw, 0.4, 0.9)
        lines = "particles:\n" + "".join(
            f"  p{i}: {{mass: m0*{decimal(draw, 0.5, 2)}, position: "
            f"[{span * i / (n + 1):.3f}, 0, {-0.3 * min(i, n + 1 - i):.3f}]}}\n"
            for i in range(1, n + 1)
        )
        ends = ["[0, 0, 0]", *(f"p{i}" for i in range(1, n + 1)), f"[{span}, 0, {decimal(draw, -0.2, 0.2)}]"]
        rows = "holonomic:\n" + "".join(
            f"  l{i}: distance({a}, {b}) = {2.0 / (n + 1):.3f}\n"
            for i, (a, b) in enumerate(itertools.pairwise(ends))
        )
        return head + lines + weight + rows + end
    if kind == "pair":
        twin = "  twin: dot(a, a) = 1\n" if draw.random() < 0.6 else ""
        return (
            head
            + (
                f"particles:\n  a: {{mass: m0, position: [{decimal(draw, 0.1, 0.8)}, 0.1, -0.7]}}\n"
                f"  b: {{mass: 2*m0, position: [0.9, {decimal(draw, -0.4, 0.4)}, -1.1]}}\n"
            )
            + weight
            + (
                "  spring: {potential: 'k/2*(distance(a, b) - 0.5)**2'}\n"
                f"holonomic:\n  rod: norm(a) = 1\n{twin}  other: 'distance(b, [1.2, 0, 0]) = 1'\n"
            )
            + end
        )
    if kind == "floor":
        tilt = decimal(draw, 0.2, 1)
        return (
            head
            + (
                f"particles:\n  a: {{mass: m0, position: [{decimal(draw, -0.5, 0.5)}, 0, {decimal(draw, 1, 2)}]}}\n"
            )
            + weight
            + (
                f"inequality:\n  left: a.z >= {tilt}*a.x\n  right: a.z >= -{decimal(draw, 0.2, 1)}*a.x\n"
                "holonomic:\n  plane: a.y = 0\n"
            )
            + end
        )
    springs = "".join(
        f"  s{i}: {{potential: 'k/2*(distance(a, [{decimal(draw, -1, 1)}, {decimal(draw, -1, 1)}, 1]) - 0.4)**2'}}\n"
        for i in range(3)
    )
    return (
        head
        + f"particles:\n  a: {{mass: m0, position: [0.1, {decimal(draw, -0.2, 0.2)}, 0]}}\n"
        + weight
        + springs
        + end
    )


def apart(at: dict[str, float], names: list[str], place: Solution) -> float:
    return max(abs(at[name] - x) for name, x in zip(names, place, strict=True))


def names(count: int) -> Iterator[str]:
    for k in range(count // 3):
        yield from (f"p{k}.{axis}" for axis in "xyz")
