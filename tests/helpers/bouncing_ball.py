"""A ball dropped on a floor in closed form: rows, incidents, and what rests of them after the rebounds have ended."""

from __future__ import annotations

import dataclasses

import numpy as np
import numpy.typing as npt

Floats = npt.NDArray[np.float64]
MODEL = """\
lagcli: 1
parameters: {m: 2, g: 9.81, h: 1, e: 0.8}
particles: {a: {mass: m, position: [0, 0, h], velocity: [0.5, 0, 0]}}
forces: {weight: {to: a, force: [0, 0, -m*g]}}
inequality: {floor: {condition: "a.z >= 0", restitution: e}}
"""
M, G, H, E, VX = 2.0, 9.81, 1.0, 0.8, 0.5
COLUMNS = (
    "t", "a.x", "a.y", "a.z", "a.vx", "a.vy", "a.vz", "lambda.floor", "R.a.x", "R.a.y", "R.a.z", "energy"
)  # fmt: skip
EVENTS = (
    "t", "impulse.floor", "a.x", "a.y", "a.z", "before.a.vx", "before.a.vy", "before.a.vz",
    "after.a.vx", "after.a.vy", "after.a.vz",
)  # fmt: skip
SLOW = 1e-7  # a rebound with less speed is the last one that is told


@dataclasses.dataclass(eq=False)
class Ball:
    """Rows (T, 12) of `COLUMNS`; kinds (E,) and incidents (E, 11) of `EVENTS`."""

    rows: Floats
    kinds: list[str]
    incidents: Floats


def ball(t: Floats) -> Ball:
    """The motion at times t (T,), with all incidents up to the last time."""
    speed, at = np.sqrt(2 * G * H), np.sqrt(2 * H / G)
    limit = at * (1 + E) / (1 - E)
    hits, met = [], []
    while speed > SLOW and at <= t[-1]:
        hits.append(at)
        met.append(speed)
        speed *= E
        at += 2 * speed / G
    z, vz = H - G * t**2 / 2, -G * t
    for hit, down in zip(hits, met, strict=True):
        s = t - hit
        z, vz = np.where(s >= 0, E * down * s - G * s**2 / 2, z), np.where(s >= 0, E * down - G * s, vz)
    rests = t >= limit
    z, vz = np.where(rests, 0.0, z), np.where(rests, 0.0, vz)
    lam = np.where(rests, M * G, 0.0)
    nothing = 0 * t
    energy = M * (VX**2 + vz**2) / 2 + M * G * z
    rows = [t, VX * t, nothing, z, VX + nothing, nothing, vz, lam, nothing, nothing, lam, energy]
    kinds = ["impact"] * len(hits)
    lines = [
        [s, M * (1 + E) * v, VX * s, 0, 0, VX, 0, -v, VX, 0, E * v] for s, v in zip(hits, met, strict=True)
    ]
    if t[-1] >= limit:
        kinds += ["accumulation", "contact"]
        lines += [[limit, 0, VX * limit, 0, 0, VX, 0, 0, VX, 0, 0]] * 2
    return Ball(np.column_stack(rows), kinds, np.array(lines, dtype=float).reshape(-1, len(EVENTS)))
