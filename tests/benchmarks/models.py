"""The model files that lagcli is given."""

from __future__ import annotations

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


# The car axis of the Test Set for IVP Solvers; m = M eps^2/2 with its M = 10, eps = 1e-2.
AXIS = {"L": 1.0, "L0": 0.5, "r": 0.1, "w": 10.0, "m": 5e-4, "g": 1.0}


def axis() -> str:
    """Two wheels on springs, one of them on a road that moves; their distance is fixed."""
    values = ", ".join(f"{name}: {value}" for name, value in AXIS.items())
    return f"""\
lagcli: 1
parameters: {{{values}}}
coordinates:
  xl: {{value: 0, rate: -L0/L}}
  yl: {{value: L0, rate: 0}}
  xr: {{value: L, rate: -L0/L}}
  yr: {{value: L0, rate: 0}}
definitions:
  yb: r*sin(w*t)
  xb: sqrt(L**2 - yb**2)
particles:
  left: {{mass: m, position: "[xl, yl, 0]"}}
  right: {{mass: m, position: "[xr, yr, 0]"}}
forces:
  weight: {{to: all, force: "[0, -m*g, 0]"}}
  spring_l: {{potential: "(sqrt(xl**2 + yl**2) - L0)**2/2"}}
  spring_r: {{potential: "(sqrt((xr - xb)**2 + (yr - yb)**2) - L0)**2/2"}}
holonomic:
  road: xl*xb + yl*yb = 0
  axle: ((xl - xr)**2 + (yl - yr)**2 - L**2)/2 = 0
"""
