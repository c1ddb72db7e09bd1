"""A run of lagcli beside the exact motion of a `SwitchedScene`: rows, multipliers, impacts and releases.

A twin of the exact motion, whose numbers are a little different, tells how much a disturbance grows; where it has
grown too much nothing is compared any more.
"""

from __future__ import annotations

import dataclasses

import numpy as np
import numpy.typing as npt

from lagcli.simulation.run_state.statistics import Incident
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
    judge = _Judge(scene, run)
    found = [
        f"lambda.{name} pulls: {low:.3g}"
        for name, lam in run.multipliers.items()
        if (low := float(lam.min(initial=0.0))) < -1e-9 * (1 + float(np.abs(lam).max(initial=0.0)))
    ]
    for k in range(run.t.size):
        if not judge.goes_on(k):
            break
        if fault := judge.row(k):
            return [*found, fault], judge.compared
    found += _incidents(judge.motion, run, judge.end, max(judge.growth, 1e-10))
    last = float(run.t[-1]) if run.t.size else 0.0
    is_early = last < judge.end - 1e-9 or (not judge.motion.why and judge.growth <= LARGEST * judge.size)
    if stopped and is_early:
        found.append(f"stopped at t = {last:.6g}: {stopped}")
    return found, judge.compared


class _Judge:
    """Rows beside the exact motion and its twin, in the order of time."""

    def __init__(self, scene: SwitchedScene, run: Table) -> None:
        self._run, self.motion = run, exact_motion.solve(scene.system)
        self._twin = exact_motion.solve(twin(scene.system))
        self._times = np.array([h.t for m in (self.motion, self._twin) for h in m.happenings] or [np.inf])
        self._names = [wall.name for wall in scene.system.walls if len(wall.pieces) == 1]
        # How far the twin is off so far, in states and in forces; the size of the states.
        self.growth, self._force_growth, self.size = 0.0, 0.0, 1.0
        self.compared, self.end = 0, 0.0

    def goes_on(self, k: int) -> bool:
        """True up to where the exact motion ends, and while a disturbance has not grown too much."""
        until = min(self.motion.until, self._twin.until)
        is_cut = bool(self.motion.why or self._twin.why)
        t = float(self._run.t[k])
        return self.growth <= LARGEST * self.size and (t < until if is_cut else t <= until)

    def row(self, k: int) -> str:
        """What is wrong with a row, if anything is."""
        t = float(self._run.t[k])
        near = float(np.abs(self._times - t).min())
        if near < CLOSE:
            return ""
        (u, v, pushes, is_unique), (u2, v2, pushes2, _) = self.motion.at(t), self._twin.at(t)
        self.growth = max(self.growth, *(np.abs(np.subtract(a, b)).max() for a, b in ((u, u2), (v, v2))))
        self.size = max(self.size, np.abs(u).max(), np.abs(v).max())
        if self.growth > LARGEST * self.size:
            return ""
        self.compared, self.end = self.compared + 1, t
        off = max(np.abs(self._run.u[k] - u).max(), np.abs(self._run.v[k] - v).max())
        if off < UNSEEN and near < SERIES:
            return ""
        if off > ALLOWED * self.size + TIMES * self.growth:
            return f"the row at t = {t:.6g} is off by {off:.2e} (a disturbance: {self.growth:.1e})"
        return self._forces(k, pushes, pushes2) if is_unique else ""

    def _forces(self, k: int, pushes: dict[str, float], of_twin: dict[str, float]) -> str:
        largest = 1.0 + max(map(abs, pushes.values()), default=0.0)
        for name in self._names:
            lam, value = pushes.get(name, 0.0), float(self._run.multipliers[name][k])
            self._force_growth = max(self._force_growth, abs(lam - of_twin.get(name, 0.0)))
            if abs(value - lam) > 10 * ALLOWED * largest + TIMES * self._force_growth:
                return f"lambda.{name} at t = {self._run.t[k]:.6g} is {value:.9g} for {lam:.9g}"
        return ""


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
