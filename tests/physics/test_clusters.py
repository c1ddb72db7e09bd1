"""Clusters of contacts whose impacts alternate: they part after finitely many, or end in common contact."""

from __future__ import annotations

import numpy as np
import pytest

import lagcli
from tests.helpers import ballistic

LETTERS = "abcdef"


def chain(masses, r, v, e, wall=None, g=0.0, duration=3.0, rope=None):
    """Bodies on a line in their order, with a wall behind the last one (its place and e), or in front of the first."""
    count = len(masses)
    contacts = []
    for i in range(count - 1):
        row = [0] * count
        row[i], row[i + 1] = -1, 1
        contacts.append((row, 0, e[i]))
    if wall is not None:
        row = [0] * count
        row[-1] = -1
        contacts.append((row, *wall))
    return {"masses": masses, "r": r, "v": v, "contacts": contacts, "a": [g] * count, "duration": duration}


def plane(mass, r, v, contacts, duration):
    """A body in a plane; contacts: (row of G, g0, e)."""
    return {"masses": [mass] * 2, "r": r, "v": v, "contacts": contacts, "a": [0.0, 0.0], "duration": duration}


def heavy_on_light(M, e, f, duration):
    """A light body on a floor, a heavy one above it that comes down."""
    contacts = [([1, 0], 0, e), ([-1, 1], -1, f)]
    return {
        "masses": [1, M], "r": [0.5, 2.0], "v": [0.0, 0.0], "contacts": contacts, "a": [-9.81] * 2, "duration": duration
    }  # fmt: skip


def onto_wall(M, e, f=None, v=1.0):
    return chain([M, 1], [0.0, 1.0], [v, 0.0], [e], (2.0, e if f is None else f))


def three(e, f=None):
    return chain([1, 1, 1], [0.0, 1.0, 2.0], [1.0, 0.1, -1.2], [e, e if f is None else f])


CASES = {
    "wall 1:1, e 0.1": onto_wall(1, 0.1),
    "wall 1:1, e 0.17, next to none": onto_wall(1, 0.17),
    "wall 1:1, e 0.18, just none": onto_wall(1, 0.18),
    "wall 10:1, e 0.3": onto_wall(10, 0.3),
    "wall 30:1, e 0.3": onto_wall(30, 0.3),
    "wall 100:1, e 0.3": onto_wall(100, 0.3),
    "wall 1e4:1, e 0.3": onto_wall(1e4, 0.3),
    "wall 1e6:1, e 0.3": onto_wall(1e6, 0.3),
    "wall 1e6:1, e 0.5": onto_wall(1e6, 0.5),
    "wall 1e4:1, e 0.9": onto_wall(1e4, 0.9),
    "wall 100:1, e 0.9, none": onto_wall(100, 0.9),
    "wall 100:1, elastic": onto_wall(100, 1),
    "wall 10:1, e 1 and 0.05": onto_wall(10, 0.05, 1),
    "wall 10:1, e 0 and 0.5": onto_wall(10, 0, 0.5),
    "three, e 0.01": three(0.01),
    "three, e 0.03": three(0.03),
    "three, e 0.05": three(0.05),
    "three, e 0.07": three(0.07),
    "three, e 0.08, none": three(0.08),
    "three, e 0.5": three(0.5),
    "three, elastic": three(1),
    "three, e 0 and 0.2": three(0, 0.2),
    "three, light in between": chain([5, 0.1, 2], [0, 1, 2], [1, 0, -1.5], [0.3, 0.4]),
    "four, e 0.02": chain([1, 1, 1, 1], [0, 1, 2, 3.5], [1, 0.3, -0.2, -1], [0.02] * 3),
    "four onto a wall": chain([3, 1, 2, 1], [0, 1, 2.2, 3], [1, 0.5, 0.2, 0], [0.05] * 3, (4.0, 0.05)),
    "five, e 0.01": chain([1] * 5, [0, 1, 2, 3.1, 4.5], [1, 0.4, 0, -0.3, -1], [0.01] * 4),
    "uphill against gravity": chain([10, 1], [0.0, 1.0], [3.0, 0.0], [0.3], (2.0, 0.3), g=1.5),
    "heavy on light 1e6, e 0.5": heavy_on_light(1e6, 0.5, 0.5, 1.2),
    "heavy on light 1e3, e 0.7": heavy_on_light(1e3, 0.7, 0.7, 0.6),
    "heavy on light 100, e 0.3": heavy_on_light(100, 0.3, 0.3, 0.5),
    "heavy on light 10, e 0.9": heavy_on_light(10, 0.9, 0.9, 0.8),
    "heavy on light 1e5, e 0.2 and 0.6": heavy_on_light(1e5, 0.2, 0.6, 0.8),
    "rope 20:1": {
        "masses": [1, 20], "r": [0.0, 0.5], "v": [0.0, 1.0], "a": [0.0, 0.0], "duration": 3.0,
        "contacts": [([1, -1], 1.0, 0.25), ([-1, 0], 0.4, 0.25)],
    },
    "wedge": plane(2, [1.0, 0.05], [-1.0, 0.2], [([0, 1], 0, 0.4), ([0.2, -1], 0, 0.4)], 2.0),
    "oblique walls": plane(1, [0.6, 0.1], [-1.0, -0.3], [([0.1, 1], 0, 0.2), ([0.3, -1], 0, 0.3)], 2.0),
}  # fmt: skip


def text(case):
    masses, r, v, a = (case[key] for key in ("masses", "r", "v", "a"))
    names = [f"{LETTERS[i]}.x" for i in range(len(r))]
    lines = ["lagcli: 1", "particles:"]
    if len({id(x) for x in masses}) == 1 and "plane" in case:
        pass
    is_plane = case in (CASES["wedge"], CASES["oblique walls"])
    if is_plane:
        names = ["a.x", "a.y"]
        lines.append(f"  a: {{mass: {masses[0]}, position: [{r[0]}, {r[1]}, 0], velocity: [{v[0]}, {v[1]}, 0]}}")
    else:
        for i, mass in enumerate(masses):
            lines.append(
                f"  {LETTERS[i]}: {{mass: {mass}, position: [{r[i]}, 0, 0], velocity: [{v[i]}, 0, 0]}}"
            )
    if any(a):
        lines.append(f'forces: {{w: {{to: all, force: "[{a[0]}*m, 0, 0]"}}}}')
    lines.append("inequality:")
    for j, (row, g0, e) in enumerate(case["contacts"]):
        gap = " + ".join(f"({x})*{name}" for x, name in zip(row, names, strict=True) if x)
        lines.append(f'  k{j}: {{condition: "{gap} + ({g0}) >= 0", restitution: {e}}}')
    lines.append(f"simulation: {{duration: {case['duration']}, samples: 11}}")
    return "\n".join(lines) + "\n"


def truth(case):
    return ballistic.flight(
        case["masses"], (case["r"], case["v"]), case["contacts"], case["a"], case["duration"]
    )
