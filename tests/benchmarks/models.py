"""The model files that lagcli is given."""

from __future__ import annotations

import numpy as np

from . import networks

RODS = {
    "square": "(dot({u}, {u}) - L**2)/2 = 0",
    "distance": "distance({a}, {b}) = L",
}


def chain(links: int, rod: str) -> str:
    """A straight chain from the origin, as families; `rod` is a key of `RODS`."""
    first = RODS[rod].format(u="p[1]", a="p[1]", b="[0, 0, 0]")
    other = RODS[rod].format(u="(p[i] - p[i-1])", a="p[i-1]", b="p[i]")
    x, y, z = (repr(float(component)) for component in networks.DIRECTION)
    return f"""\
lagcli: 1
parameters: {{N: {links}, L: 1, m: 1, g: {networks.GRAVITY}, dx: {x}, dy: {y}, dz: {z}}}
particles:
  p[i]: {{for: "i = 1..N", mass: m, position: "[i*dx, i*dy, i*dz]"}}
forces:
  weight: {{to: p, force: "[0, 0, -m*g]"}}
holonomic:
  hook: "{first}"
  rod[i]: {{for: "i = 2..N", equation: "{other}"}}
"""


def plane(network: networks.Network) -> str:
    """Points and rods in the plane of x and z, in coordinates x1, z1, ... of those that move."""
    points = [[f"{float(x)!r}", f"{float(z)!r}"] for x, z in network.points]
    coordinates, particles = "", ""
    for k in network.free:
        x, z = points[k]
        coordinates += f"  x{k}: {{value: {x}}}\n  z{k}: {{value: {z}}}\n"
        particles += f'  p{k}: {{mass: 1, position: "[x{k}, 0, z{k}]"}}\n'
        points[k] = [f"x{k}", f"z{k}"]
    rods = ""
    for i, j in network.rods:
        length = float(np.linalg.norm(network.points[i] - network.points[j]))
        ends = ", ".join(f"[{x}, 0, {z}]" for x, z in (points[i], points[j]))
        rods += f'  rod{j}: "distance({ends}) = {length!r}"\n'
    return f"""\
lagcli: 1
coordinates:
{coordinates}particles:
{particles}forces:
  weight: {{to: all, force: "[0, 0, -{networks.GRAVITY}*m]"}}
holonomic:
{rods}"""


def cloth(side: int) -> str:
    """The net of rods of `networks.cloth`, as families."""
    radius, turn = networks.cylinder(side)
    along = "distance(p[i-1][j], p[i][j]) = L"
    across = "distance(p[i][j-1], p[i][j]) = L"
    angle = "(i - (N + 1)/2)*turn"
    return f"""\
lagcli: 1
parameters: {{N: {side}, L: 1, m: 1, g: {networks.GRAVITY}, radius: {radius!r}, turn: {turn!r}}}
particles:
  p[i][j]:
    for: ["i = 1..N", "j = 1..N"]
    mass: m
    position: "[radius*sin({angle}), j - 1, -radius*cos({angle})]"
forces:
  weight: {{to: p, force: "[0, 0, -m*g]"}}
holonomic:
  pin_1: "p[1][1] = [radius*sin((1 - N)/2*turn), 0, -radius*cos((1 - N)/2*turn)]"
  pin_2: "p[N][1] = [radius*sin((N - 1)/2*turn), 0, -radius*cos((N - 1)/2*turn)]"
  along[i][j]: {{for: ["i = 2..N", "j = 1..N"], equation: "{along}"}}
  across[i][j]: {{for: ["i = 1..N", "j = 2..N"], equation: "{across}"}}
"""


DISK = {"a": 0.5, "M": 2.0, "spin": 4.0, "turn": 1.25}


def disk() -> str:
    """The vertical rolling disk of the gallery (models/rolling-disk.yaml), without its outputs."""
    values = ", ".join(f"{name}: {value}" for name, value in DISK.items())
    return f"""\
lagcli: 1
parameters: {{{values}, I_roll: M*a**2/2, I_turn: M*a**2/4}}
coordinates:
  x: {{value: 0, rate: 0}}
  y: {{value: 0, rate: -a*spin}}
  theta: {{value: 0, rate: turn}}
  phi: {{value: 0, rate: spin}}
lagrangian: M*(rate(x)**2 + rate(y)**2)/2 + I_roll*rate(phi)**2/2 + I_turn*rate(theta)**2/2
differential:
  roll_x: d(x) - a*sin(theta)*d(phi) = 0
  roll_y: d(y) + a*cos(theta)*d(phi) = 0
"""
