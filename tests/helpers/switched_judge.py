"""A run of lagcli beside the exact motion of a `SwitchedScene`: rows, multipliers, impacts and releases.

A twin of the exact motion, whose numbers are a little different, tells how much a disturbance grows; where it has
grown too much nothing is compared any more.
"""

from __future__ import annotations

import dataclasses

import numpy as np
import numpy.typing as npt

from lagcli.simulation.run_state.incident import Incident
from tests.helpers import exact_motion
from tests.helpers.exact_motion import Law, Motion, System
from tests.helpers.switched_scenes import SwitchedScene

Floats = npt.NDArray[np.float64]

NUDGE = 1e-9  # how different the twin is, of each number
LARGEST = 1e-5  # a growth at which comparing ends
CLOSE = 2e-6  # rows this near to an incident are not compared: they may lie on its other side
APART, SLOW = 1e-4, 1e-3  # impacts that are looked for one by one: so far from others, and so fast
# Beside an incident speeds may be dropped of rebounds that rise no higher than rounding.
UNSEEN, SERIES = 1e-6, 1e-3
ALLOWED, TIMES = 2e-8, 5.0  # what may be off, as a part of the size, and of what the twin is off


@dataclasses.dataclass(frozen=True, slots=True)
class Table:
    """t (T,), u and v (T, n), multipliers by name (T,), and the incidents."""

    t: Floats
    u: Floats
    v: Floats
    multipliers: dict[str, Floats]
    incidents: list[Incident]


def table(scene: SwitchedScene, columns: tuple[str, ...], rows: Floats, incidents: list[Incident]) -> Table:
    """The columns that are judged."""
    at = {name: k for k, name in enumerate(columns)}
    # A condition that is the least of several has a multiplier for each of them.
    multipliers = {name[7:]: rows[:, k] for name, k in at.items() if name.startswith("lambda.")}
    for k in range(len(scene.system.rows)):
        del multipliers[f"row{k}"]
    u, v = (rows[:, [at[name] for name in names]] for names in (scene.names(), scene.rates()))
    return Table(rows[:, 0], u, v, multipliers, incidents)


def twin(system: System) -> System:
    """The system with masses and forces, and free coordinates of the start, a little different."""
    random = np.random.default_rng(5)

    def moved(text: str) -> str:
        return repr(float(text) * (1 + NUDGE * random.normal()))

    def law(given: Law) -> Law:
        bends = tuple((s, moved(c), power) for s, c, power in given.bends)
        return Law(tuple(map(moved, given.powers)), bends)

    masses = tuple(map(moved, system.masses))
    closed: set[int] = set()
    for wall in system.walls:
        for row, level in wall.pieces:
            gap = sum(float(a) * float(x) for a, x in zip(row, system.u, strict=True))
            if (
                abs(gap - float(level.taylor(exact_motion.MP.mpf(system.start))[0] if level.powers else 0))
                < 1e-9
            ):
                closed |= {i for i, a in enumerate(row) if float(a)}
    is_free = [not system.rows and i not in closed for i in range(len(masses))]
    u, v = (
        tuple(
            repr(float(x) + NUDGE * random.normal()) if free else x
            for x, free in zip(part, is_free, strict=True)
        )
        for part in (system.u, system.v)
    )
    forces = tuple(map(law, system.forces))
    return dataclasses.replace(system, masses=masses, u=u, v=v, forces=forces)


def faults(scene: SwitchedScene, run: Table, stopped: str = "") -> tuple[list[str], int]:
    """What is wrong with a run, and the number of rows that were compared; stopped: why the run ended early."""
    motion, other = exact_motion.solve(scene.system), exact_motion.solve(twin(scene.system))
    found = [
        f"lambda.{name} pulls: {low:.3g}"
        for name, lam in run.multipliers.items()
        if (low := float(lam.min(initial=0.0))) < -1e-9 * (1 + float(np.abs(lam).max(initial=0.0)))
    ]
    times = np.array(sorted({h.t for m in (motion, other) for h in m.happenings}))
    growth, force_growth, compared, end = 0.0, 0.0, 0, 0.0
    sizes = 1.0
    is_exact = [wall.name for wall in scene.system.walls if len(wall.pieces) == 1]
    until = min(motion.until, other.until)
    for k, t in enumerate(run.t):
        if t >= until and (motion.why or other.why or t > until):
            break
        if times.size and np.abs(times - t).min() < CLOSE:
            continue
        (u, v, pushes, is_unique), (u2, v2, pushes2, _) = motion.at(t), other.at(t)
        growth = max(growth, *(np.abs(np.subtract(a, b)).max() for a, b in ((u, u2), (v, v2))))
        sizes = max(sizes, np.abs(u).max(), np.abs(v).max())
        if growth > LARGEST * sizes:
            break
        compared, end = compared + 1, t
        off = max(np.abs(run.u[k] - u).max(), np.abs(run.v[k] - v).max())
        if off < UNSEEN and times.size and np.abs(times - t).min() < SERIES:
            continue
        if off > ALLOWED * sizes + TIMES * growth:
            return [
                *found,
                f"the row at t = {t:.6g} is off by {off:.2e} (a disturbance: {growth:.1e})",
            ], compared
        if not is_unique:
            continue
        largest = 1.0 + max(map(abs, pushes.values()), default=0.0)
        for name in is_exact:
            lam, lam2 = pushes.get(name, 0.0), pushes2.get(name, 0.0)
            force_growth = max(force_growth, abs(lam - lam2))
            if abs(run.multipliers[name][k] - lam) > 10 * ALLOWED * largest + TIMES * force_growth:
                value = run.multipliers[name][k]
                return [*found, f"lambda.{name} at t = {t:.6g} is {value:.9g} for {lam:.9g}"], compared
    found += _incidents(motion, run, end, max(growth, 1e-10))
    if stopped and (
        not run.t.size or run.t[-1] < end - 1e-9 or (not motion.why and growth <= LARGEST * sizes)
    ):
        found.append(f"stopped at t = {run.t[-1] if run.t.size else 0:.6g}: {stopped}")
    return found, compared


def _incidents(motion: Motion, run: Table, end: float, growth: float) -> list[str]:
    """Impacts and releases up to a time that the run does not have."""
    found = []
    for k, happened in enumerate(motion.happenings):
        if happened.t >= end or happened.kind == "end":
            continue
        beside = [motion.happenings[j].t for j in (k - 1, k + 1) if 0 <= j < len(motion.happenings)]
        if any(abs(t - happened.t) < APART for t in beside):
            continue
        if happened.kind == "impact" and np.abs(np.subtract(happened.after, happened.before)).max() < SLOW:
            continue
        # Where a force lets go as a power of t, the instant is known to a root of what is known.
        room = 1e-8 + 1e3 * growth if happened.kind == "impact" else 1e-5 + np.sqrt(growth)
        # The walls of a minimum have numbers behind its name.
        names = {
            each.name.partition("[")[0]
            for each in run.incidents
            if each.kind == happened.kind and abs(each.t - happened.t) < room
        }
        if missing := set(happened.walls) - names:
            found.append(f"no {happened.kind} of {', '.join(sorted(missing))} at t = {happened.t!r}")
    return found[:3]
