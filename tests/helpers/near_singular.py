"""Random models at, near and off singular places, with the rank of their rows at the start in closed form."""

from __future__ import annotations

from dataclasses import dataclass
from fractions import Fraction

import numpy as np

SIZES = (0.0, 1e-2, 1e-3, 1e-4, 1e-5, 1e-6, 1e-7, 1e-8, 1e-9, 1e-10, 1e-11, 1e-12)


@dataclass(frozen=True)
class NearSingular:
    """The text of a model, the rank of its rows at the start, how far they are from dependent ones, about, and if they
    are so at all other points."""

    text: str
    rows: int
    rank: int
    distance: float
    is_everywhere: bool = True


def model(seed: int) -> NearSingular:
    """One of several kinds: planes, spheres that touch, linkages near their flat position, differential rows."""
    random = np.random.default_rng(seed)
    size = SIZES[int(random.integers(len(SIZES)))]
    kinds = (_planes, _spheres, _linkage, _differential, _moving)
    return kinds[seed % len(kinds)](random, size)


def _text(blocks: str, position: tuple[object, ...], velocity: str = "[0, 0, 0]") -> str:
    start = ", ".join(str(x) for x in position)
    return (
        f"lagcli: 1\nparticles: {{a: {{mass: 1, position: [{start}], velocity: {velocity}}}}}\n"
        'forces: {spring: {potential: "2*a.x**2 + 3*a.y**2 + 5*a.z**2"}}\n'
        f"{blocks}simulation: {{duration: 0.1, samples: 2}}\n"
    )


def _vector(random: np.random.Generator, n: int = 3) -> list[int]:
    found = [0] * n
    while not any(found):
        found = [int(k) for k in random.integers(-3, 4, n)]
    return found


def _linear(u: list[int], names: tuple[str, ...] = ("a.x", "a.y", "a.z")) -> str:
    return " + ".join(f"{k}*{name}" for k, name in zip(u, names, strict=True) if k)


def _independent(random: np.random.Generator) -> tuple[list[int], list[int]]:
    while True:
        u, w = _vector(random), _vector(random)
        if np.linalg.matrix_rank(np.array([u, w])) == 2:
            return u, w


def _planes(random: np.random.Generator, size: float) -> NearSingular:
    """u r = c, and k u r + size w r = k c + size e, through one point of tenths."""
    u, w = _independent(random)
    q = [Fraction(int(k), 10) for k in random.integers(-9, 10, 3)]
    c, e = (sum(a * b for a, b in zip(each, q, strict=True)) for each in (u, w))
    k = int(random.integers(1, 4))
    rows = f'  first: "{_linear(u)} = {float(c)!r}"\n'
    near = f"{k}*({_linear(u)})" + (f" + d*({_linear(w)})" if size else "")
    right = f"{k}*({float(c)!r})" + (f" + d*({float(e)!r})" if size else "")
    text = f"parameters: {{d: {size!r}}}\nholonomic:\n{rows}" + f'  second: "{near} = {right}"\n'
    return NearSingular(_text(text, tuple(map(float, q))), 2, 2 if size else 1, size / 3)


def _spheres(random: np.random.Generator, size: float) -> NearSingular:
    """Two spheres through one point, whose normals make an angle of about `size` there."""
    R = int(random.integers(1, 4))
    first = f'  first: "a.x**2 + a.y**2 + a.z**2 = {R}**2"\n'
    # The second has its centre on a line that leaves the origin aside: (R/2, size, 0) + ... through (R, 0, 0).
    second = f'  second: "(a.x - {R}/2)**2 + (a.y - d)**2 + a.z**2 = ({R}/2)**2 + d**2"\n'
    text = f"parameters: {{d: {size!r}}}\nholonomic:\n{first}{second}"
    return NearSingular(_text(text, (R, 0, 0)), 2, 2 if size else 1, size / R, is_everywhere=False)


def _linkage(random: np.random.Generator, size: float) -> NearSingular:
    """A rhomboid four-bar linkage, `size` radians off its flat position."""
    L = int(random.integers(1, 3))
    size = size if size >= 1e-8 else 0.0  # the doubles of smaller angles do not lie on the rows so exactly
    text = f"""lagcli: 1
parameters: {{e: {size!r}}}
particles:
  a: {{mass: 1, position: ["{L}*cos(e)", 0, "{L}*sin(e)"]}}
  b: {{mass: {int(random.integers(1, 4))}, position: ["{L}*cos(e) + 1", 0, "{L}*sin(e)"]}}
forces: {{spring: {{potential: "a.z**2 + b.z**2 + 3*a.y**2 + 3*b.y**2"}}}}
holonomic:
  crank: "distance(a, [0, 0, 0]) = {L}"
  coupler: "distance(a, b) = 1"
  rocker: "distance(b, [1, 0, 0]) = {L}"
  plane: "a.y = 0"
  other: "b.y = 0"
simulation: {{duration: 0.01, samples: 2}}
"""
    return NearSingular(text, 5, 5 if size else 4, size, is_everywhere=False)


def _differential(random: np.random.Generator, size: float) -> NearSingular:
    """Two rows in differentials with constant coefficients."""
    u, w = _independent(random)
    names = ("d(a.x)", "d(a.y)", "d(a.z)")
    near = f"2*({_linear(u, names)})" + (f" + e*({_linear(w, names)})" if size else "")
    text = (
        f"parameters: {{e: {size!r}}}\ndifferential:\n"
        f'  first: "{_linear(u, names)} = 0"\n  second: "{near} = 0"\n'
    )
    return NearSingular(_text(text, (0.1, -0.2, 0.3)), 2, 2 if size else 1, size / 3)


def _moving(random: np.random.Generator, size: float) -> NearSingular:
    """Two planes that move along with one velocity."""
    u, w = _independent(random)
    c = [int(k) for k in random.integers(-3, 4, 3)]  # a point of whole numbers, and the velocity too
    at, rate = (sum(a * b for a, b in zip(each, c, strict=True)) for each in (u, w))
    near = f"2*({_linear(u)})" + (f" + d*({_linear(w)})" if size else "")
    right = f"2*{at}*(1 + t)" + (f" + d*{rate}*(1 + t)" if size else "")
    text = (
        f"parameters: {{d: {size!r}}}\nholonomic:\n"
        f'  first: "{_linear(u)} = {at}*(1 + t)"\n  second: "{near} = {right}"\n'
    )
    velocity = "[" + ", ".join(map(str, c)) + "]"
    return NearSingular(_text(text, tuple(c), velocity), 2, 2 if size else 1, size / 3)
