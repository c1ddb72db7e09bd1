"""Random systems of `exact_motion` with switches and clusters of contacts, and their texts for lagcli."""

from __future__ import annotations

import dataclasses

import numpy as np

from tests.helpers.exact_motion import Law, Relay, System, Wall

KINDS = ("rest", "line", "plane", "trap", "edge", "pulley")
RESTITUTIONS = ("0", "0.01", "0.2", "0.3", "0.5", "0.7", "0.9", "1")


@dataclasses.dataclass(frozen=True, slots=True)
class SwitchedScene:
    """A system, and how it is written: particles along x (axes 1), in x and z (2), or coordinates (0)."""

    kind: str
    system: System
    axes: int

    def names(self) -> list[str]:
        """The columns of u."""
        count = len(self.system.u)
        if not self.axes:
            return [f"q{i}" for i in range(count)]
        return [f"p{i // self.axes}.{'xz'[i % self.axes]}" for i in range(count)]

    def rates(self) -> list[str]:
        """The columns of v."""
        if not self.axes:
            return [f"rate({name})" for name in self.names()]
        return [name.replace(".", ".v") for name in self.names()]

    def text(self) -> str:
        """The model file."""
        system, names = self.system, self.names()
        lines, forces = ["lagcli: 1"], [law.text() for law in system.forces]
        for relay in system.relays:
            forces[relay.on] += f" + ({relay.size})*sign({names[relay.of]} - ({relay.value}))"
        if self.axes:
            lines += ["particles:"]
            force_lines = []
            for i in range(len(system.u) // self.axes):
                k = i * self.axes
                x, v, F = (self._vector(part, k) for part in (system.u, system.v, forces))
                lines.append(f"  p{i}: {{mass: {system.masses[k]}, position: [{x}], velocity: [{v}]}}")
                force_lines.append(f'  f{i}: {{to: p{i}, force: "[{F}]"}}')
        else:
            lines += ["coordinates:"]
            lines += [
                f"  {q}: {{value: {x}, rate: {v}}}" for q, x, v in zip(names, system.u, system.v, strict=True)
            ]
            terms = [f"{m}/2*rate({q})**2" for m, q in zip(system.masses, names, strict=True)]
            lines.append(f'lagrangian: "{" + ".join(terms)}"')
            force_lines = [
                f'  f{i}: {{to: {q}, force: "{F}"}}'
                for i, (q, F) in enumerate(zip(names, forces, strict=True))
            ]
        lines += ["forces:", *force_lines]
        if system.rows:
            lines.append("holonomic:")
            for k, row in enumerate(system.rows):
                level = sum(float(c) * float(u) for c, u in zip(row, system.u, strict=True))
                lines.append(f'  row{k}: "{self._combined(row)} = {level!r}"')
        lines.append("inequality:")
        for wall in system.walls:
            pieces = [f"{self._combined(row)} - ({law.text()})" for row, law in wall.pieces]
            gap = pieces[0] if len(pieces) == 1 else f"{wall.joined}({', '.join(pieces)})"
            lines.append(f'  {wall.name}: {{condition: "{gap} >= 0", restitution: {wall.e}}}')
        lines.append(f"simulation: {{start: {system.start}, duration: {system.duration}, samples: 61}}")
        return "\n".join(lines) + "\n"

    def _vector(self, numbers: tuple[str, ...] | list[str], k: int) -> str:
        return f"{numbers[k]}, 0, {numbers[k + 1] if self.axes == 2 else 0}"

    def _combined(self, row: tuple[str, ...]) -> str:
        return " + ".join(f"({c})*{name}" for c, name in zip(row, self.names(), strict=True) if float(c))


class _Maker:
    def __init__(self, seed: int) -> None:
        self.random = np.random.default_rng([seed, 27])

    def number(self, low: float, high: float) -> str:
        return f"{self.random.uniform(low, high):.4g}"

    def chance(self, part: float) -> bool:
        return bool(self.random.random() < part)

    def mass(self) -> str:
        return f"{10 ** self.random.uniform(-1, 1) if self.chance(0.7) else 10 ** self.random.uniform(-3, 4):.3g}"

    def restitution(self) -> str:
        return str(self.random.choice(RESTITUTIONS))

    def times(self, count: int) -> list[str]:
        return [f"{t:.3g}" for t in np.sort(self.random.uniform(0.1, 2.8, count))]

    def load(self, level: float) -> Law:
        """A force that jumps, bends, or pulses, about a level."""
        powers = [f"{level:.4g}"]
        if self.chance(0.2):
            powers.append(self.number(-2, 2))
        bends = []
        for t in self.times(int(self.random.integers(0, 4))):
            bends.append((t, self.number(-4, 12), int(self.random.choice([0, 0, 1, 2, 3]))))
        if self.chance(0.4):
            begin, end = self.times(2)
            size = self.number(-8, 20)
            bends += [(begin, size, 0), (end, str(-float(size)), 0)]
        return Law(tuple(powers), tuple(bends))

    def wall(self, level: str, is_closed: bool = False) -> Law:
        """A wall that starts at a level, and moves and bends."""
        powers = (level,)
        if not is_closed and self.chance(0.4):
            powers = (level, self.number(-0.3, 0.3))
        bends = tuple(
            (t, self.number(-2, 1), int(self.random.choice([1, 1, 2, 3])))
            for t in self.times(int(self.random.integers(0, 3)))
        )
        return Law(powers, bends)


def _rest(make: _Maker) -> tuple[SwitchedScene, ...] | SwitchedScene:
    """Masses that lie on floors, one on the other, under loads that switch."""
    count = int(make.random.integers(1, 4))
    weights = [float(make.mass()) for _ in range(count)]
    e = make.restitution()
    walls, u, level = [], [], 0.0
    for i in range(count):
        row = ["0"] * count
        row[i] = "1"
        on_other = i > 0 and make.chance(0.4)
        if on_other:
            row[i - 1] = "-1"
            level = float(u[i - 1]) + 1.0
            walls.append(Wall(f"c{i}", ((tuple(row), Law(("1",))),), e))
        else:
            level = 0.0
            walls.append(Wall(f"c{i}", ((tuple(row), make.wall("0", True)),), e))
        u.append(f"{level:g}")
    # Some loads begin with a power of t: nothing presses at first.
    forces = []
    for m in weights:
        law = make.load(-m * 9.81)
        if make.chance(0.25):
            law = Law(("0", *["0"] * int(make.random.integers(0, 3)), make.number(-9, -1)), law.bends)
        forces.append(law)
    masses = tuple(f"{m:g}" for m in weights)
    system = System(masses, tuple(u), ("0",) * count, tuple(forces), tuple(walls))
    return SwitchedScene("rest", system, int(make.random.integers(0, 2)))


def _line(make: _Maker) -> SwitchedScene:
    """Balls on a line, often between walls."""
    count = int(make.random.integers(2, 5))
    u = np.cumsum(make.random.uniform(0.3, 1.2, count))
    e = make.restitution()
    walls = []
    for i in range(count - 1):
        row = ["0"] * count
        row[i], row[i + 1] = "-1", "1"
        walls.append(Wall(f"c{i}", ((tuple(row), Law((make.number(0, 0.2),))),), e))
    ends = [["0"] * count, ["0"] * count]
    ends[0][0], ends[1][-1] = "1", "-1"
    for k, end in enumerate(ends):
        if make.chance(0.6):
            level = make.number(-0.6, 0.1) if k == 0 else f"{-(u[-1] + make.random.uniform(0.1, 0.8)):.4g}"
            walls.append(Wall(f"w{k}", ((tuple(end), make.wall(level)),), e))
    still = make.chance(0.5)
    masses = [make.mass() for _ in range(count)]
    forces = tuple(Law() if still else make.load(float(m) * make.random.uniform(-4, 4)) for m in masses)
    v = tuple(make.number(-1.5, 1.5) for _ in range(count))
    system = System(tuple(masses), tuple(f"{x:.4g}" for x in u), v, forces, tuple(walls))
    return SwitchedScene("line", system, int(make.random.integers(0, 2)))


def _plane(make: _Maker) -> SwitchedScene:
    """Balls above inclined floors, pushed by relays that switch with their place."""
    count = int(make.random.integers(1, 3))
    n, e = 2 * count, make.restitution()
    u, v, forces, walls, relays, masses = [], [], [], [], [], []
    for i in range(count):
        m = make.mass()
        slope = make.number(-0.4, 0.4)
        x = make.number(-0.5, 0.5)
        is_closed = make.chance(0.6)
        level = make.number(-0.2, 0.2)
        z = float(slope) * float(x) + float(level) + (0.0 if is_closed else make.random.uniform(0.05, 1))
        vx = make.number(-1, 1)
        vz = f"{float(slope) * float(vx)!r}" if is_closed else make.number(-1, 1)
        row = ["0"] * n
        row[2 * i], row[2 * i + 1] = str(-float(slope)), "1"
        if is_closed:
            z_text, vz, slope_free = level, "0", "0"
            row[2 * i] = slope_free
        else:
            z_text = f"{z:.6g}"
        walls.append(Wall(f"floor{i}", ((tuple(row), make.wall(level, is_closed)),), e))
        if make.chance(0.5):
            side = ["0"] * n
            side[2 * i] = "-1"
            walls.append(Wall(f"side{i}", ((tuple(side), make.wall(f"-{abs(float(x)) + 0.7:.4g}")),), e))
        masses += [m, m]
        u += [x, z_text]
        v += [vx, vz]
        forces += [make.load(0.0) if make.chance(0.3) else Law(), make.load(-float(m) * 9.81)]
        if make.chance(0.5):
            value = f"{float(x) + np.sign(float(vx)) * make.random.uniform(0.05, 0.4):.4g}"
            relays.append(Relay(2 * i + 1, 2 * i, value, f"{float(m) * make.random.uniform(2, 15):.4g}"))
    system = System(tuple(masses), tuple(u), tuple(v), tuple(forces), tuple(walls), tuple(relays))
    return SwitchedScene("plane", system, 2)


def _trap(make: _Maker) -> SwitchedScene:
    """A light ball between heavy ones or walls, and balls on a rope: clusters that may collapse."""
    count = int(make.random.integers(2, 4))
    u = np.cumsum(make.random.uniform(0.4, 1.0, count))
    e = str(make.random.choice(["0", "0.01", "0.05", "0.2", "0.3", "0.4", "0.6", "0.8"]))
    masses = [make.mass() for _ in range(count)]
    walls = []
    for i in range(count - 1):
        row = ["0"] * count
        row[i], row[i + 1] = "-1", "1"
        walls.append(Wall(f"c{i}", ((tuple(row), Law()),), e))
        if make.chance(0.35):
            back = ["0"] * count
            back[i], back[i + 1] = "1", "-1"
            length = f"{-(u[i + 1] - u[i]) - make.random.uniform(0.05, 0.5):.4g}"
            walls.append(Wall(f"rope{i}", ((tuple(back), Law((length,))),), e))
    end = ["0"] * count
    end[-1] = "-1"
    if make.chance(0.7):
        wall = f"{-(u[-1] + make.random.uniform(0.1, 0.8)):.4g}"
        walls.append(Wall("wall", ((tuple(end), Law((wall,))),), e))
    v = [make.number(0.2, 1.5), *(make.number(-0.5, 0.5) for _ in range(count - 2)), make.number(-1.5, 0.3)]
    push = make.chance(0.4)
    forces = tuple(Law((f"{float(m) * 9.81:.4g}",)) if push and make.chance(0.7) else Law() for m in masses)
    system = System(tuple(masses), tuple(f"{x:.4g}" for x in u), tuple(v), forces, tuple(walls))
    return SwitchedScene("trap", system, int(make.random.integers(0, 2)))


def _edge(make: _Maker) -> SwitchedScene:
    """A ball that slides or falls over an edge (max) or into a corner (min)."""
    joined = "max" if make.chance(0.6) else "min"
    m, e = make.mass(), make.restitution()
    a, b = make.number(-0.5, 0.5), make.number(0.8, 3)
    one, other = ((str(-float(a)), "1"), Law()), ((b, "1"), Law((make.number(-0.4, 0.4),)))
    x, z = make.number(-1.5, -0.5), make.number(0.3, 1.5)
    walls = [Wall("ground", (one, other), e, joined)]
    floor = Wall("floor", ((("0", "1"), make.wall("-3")),), e)
    u = (x, z)
    if joined == "max":
        z = f"{max(float(a) * float(x), -float(b) * float(x) + float(other[1].powers[0])) + 0.5:.4g}"
        u = (x, z)
    else:
        u = (x, f"{abs(float(b) * float(x)) + 2:.4g}")
    forces = (make.load(0.0) if make.chance(0.3) else Law(), make.load(-float(m) * 9.81))
    v = (make.number(0.3, 2), make.number(-1, 1))
    system = System((m, m), u, v, forces, (*walls, floor))
    return SwitchedScene("edge", system, 2)


def _pulley(make: _Maker) -> SwitchedScene:
    """Masses on a string over a pulley, one of which lies on a floor: a linear row carries impulses."""
    m, e = [make.mass(), make.mass(), make.mass()], make.restitution()
    heights = [make.number(0.1, 1), make.number(0.1, 1), "0"]
    walls = [
        Wall("left", ((("1", "0", "0"), make.wall("0")),), e),
        Wall("right", ((("0", "1", "0"), make.wall("-0.2")),), e),
        Wall("below", ((("0", "0", "1"), make.wall("0", True)),), e),
    ]
    v = make.number(-1, 1)
    forces = tuple(make.load(-9.81 * float(each)) for each in m)
    rows = (("1", "1", "0"),)
    if make.chance(0.4):
        walls.append(Wall("pair", ((("0", "1", "-1"), Law(("0.05",))),), e))
    system = System(tuple(m), tuple(heights), (v, str(-float(v)), "0"), forces, tuple(walls), rows=rows)
    return SwitchedScene("pulley", system, int(make.random.integers(0, 2)))


MAKERS = {"rest": _rest, "line": _line, "plane": _plane, "trap": _trap, "edge": _edge, "pulley": _pulley}


def scene(seed: int) -> SwitchedScene:
    """The scene of a number."""
    make = _Maker(seed)
    return MAKERS[KINDS[seed % len(KINDS)]](make)
