"""The stiff runs of `lagcli.limit`, one for each stiffness or one in which it rises, beside the constrained run."""

from __future__ import annotations

import contextlib
import dataclasses
import math
import time
from collections.abc import Callable
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from lagcli import doubles
from lagcli.analysis.classification.verdict import KnownIntegrals
from lagcli.api import prepare_run
from lagcli.api.cache import CompiledModel
from lagcli.arrays import Floats
from lagcli.errors import diagnostics
from lagcli.formulations import stiff_ladder, stiff_system
from lagcli.formulations.stiff_ladder import Rung, StiffLimit
from lagcli.formulations.stiff_system import Stiffness, StiffRow
from lagcli.model.model import Model
from lagcli.model.settings import Simulation
from lagcli.running import table_columns
from lagcli.running.simulation_run import SimulationRun
from lagcli.simulation.run_state import run_stop

# Rows in a swing, by which means are taken, and the most rows of a run.
IN_A_SWING, MOST_ROWS = 16, 400_000
# The run that tells the uncertainty has this many times the tolerance; where rounding takes part, the errors of the two
# are nearly equal, and what they differ by is divided by little.
LOOSER, LARGER = 100.0, 2.0
# Steps of a swing at the usual tolerance: an estimate until the first run has been made.
STEPS_IN_A_SWING = 12.0
NO_RATE = "of a ramp no rate is fitted: its errors are swings that the soft spring began, and they keep their action"


@dataclasses.dataclass(frozen=True, slots=True)
class LimitPlan:
    """A limit that is asked for: the name of the row, the stiffnesses, the kind of start, and whether k rises in one
    run; `report` takes sentences on what is about to take long."""

    constraint: str
    stiffness: tuple[float, ...]
    unprestressed: bool
    is_ramp: bool
    report: Callable[[str], None]


class _Followed(NamedTuple):
    """A stiff run: -k f (T,) on its grid, accepted steps, seconds, the uncertainty of the force (rows,) at the rows."""

    force: Floats
    steps: int
    seconds: float
    uncertainty: Floats


def limit(model: Model, chosen: Simulation, plan: LimitPlan) -> StiffLimit:
    """The limit of one row. Raises `ModelError` where the row has none, `ValueError` for a name there is not."""
    for law in model.inequality:
        if law.members.count:
            raise diagnostics.error(
                "no-stiff-limit",
                "no limit is taken of models with inequalities: a blow on a spring goes on swinging, and is not that"
                " on a constraint, however stiff it is",
                law.equation.location,
                "take the inequality out, if it plays no part",
            )
    first = prepare_run.start(model, chosen)
    index = _row(first, plan.constraint)
    row, notes = first.built.rows.rows[index].name, [*prepare_run.moves_of(first)]
    if any(event.action == "stop" for event in model.events):
        with contextlib.suppress(run_stop.RunStop):
            for _ in first.blocks():
                pass
            name = first.stats.ended_by
            if name is not None and first.end > chosen.start:
                where = f"t = {first.end:.9g}: the limit is taken up to there"
                notes.append(f"the event `{name}` ends the constrained run at {where}")
                chosen = dataclasses.replace(chosen, duration=first.end - chosen.start)
    rate_of = "weighted_mean" if plan.unprestressed or plan.is_ramp else "max_error"
    kind = "unprestressed" if plan.unprestressed else "adapted"
    nothing = np.zeros(0)
    empty = StiffLimit(model.path, row, kind, nothing, nothing, (), None, rate_of)
    try:
        runs = _StiffRuns(model, chosen, index, plan)
    except run_stop.RunStop as stop:
        reason = f"the constrained run stopped at t = {stop.stop.t:.9g}: {stop.stop.reason}"
        return dataclasses.replace(empty, stopped=reason)
    t, multiplier = runs.at(1)
    empty = dataclasses.replace(empty, t=t, multiplier=multiplier)
    try:
        found = runs.ramp(empty) if plan.is_ramp else runs.ladder(empty)
    except run_stop.RunStop as stop:
        reason = f"the stiff run stopped at t = {stop.stop.t:.9g}: {stop.stop.reason}"
        found = dataclasses.replace(empty, stopped=reason)
    return dataclasses.replace(found, notes=(*notes, *found.notes))


def _row(first: SimulationRun, name: str) -> int:
    """The number of the row of this name. Raises `diagnostics.ModelError` where it has no limit, `ValueError`."""
    built = first.built
    rows, s = built.rows.rows, built.holonomic_count
    named = [i for i, row in enumerate(rows) if row.name == name] or [
        i
        for i, row in enumerate(rows)
        if row.constraint == name or row.name.startswith((f"{name}[", f"{name}."))
    ]
    if not named:
        known = [row.name for row in rows[:s]]
        hint = diagnostics.nearest(name, known) or (
            f"they are {', '.join(known[:6])}" if known else "there is none"
        )
        raise ValueError(f"constraint: there is no holonomic row `{name}`; {hint}")
    if named[0] >= s:
        raise diagnostics.error(
            "no-stiff-limit",
            f"`{name}` is a differential row: it is no surface f = 0 from which a spring could be stretched",
            rows[named[0]].location,
            "if `check` finds it integrable, write its integral under `holonomic`",
        )
    if len(named) > 1:
        hint = f"its rows are `{rows[named[0]].name}` to `{rows[named[-1]].name}`"
        raise ValueError(f"constraint: `{name}` is {len(named)} rows, and one becomes a spring; {hint}")
    (index,) = named
    if index in first.report.selection.indeterminate:
        raise diagnostics.error(
            "no-stiff-limit",
            f"the row `{rows[index].name}` is redundant: others hold it when it becomes a spring, which then has no"
            " force, and its multiplier is not unique",
            rows[index].location,
            "take the rows out that repeat it",
        )
    if stiff_system.has_cut(built, index):
        raise diagnostics.error(
            "no-stiff-limit",
            f"f of the row `{rows[index].name}` has the cut of an angle, where the potential k f^2/2 would jump",
            rows[index].location,
            "write the row without `atan2`, or name the angle as a coordinate",
        )
    return index


def looser(chosen: Simulation) -> Simulation:
    """The settings with a larger tolerance."""
    atol = None if chosen.atol is None else LOOSER * chosen.atol
    return dataclasses.replace(chosen, rtol=min(LOOSER * chosen.rtol, 0.1), atol=atol)


def refinement(rows: int, swings: float) -> int:
    """The power of two by which the rows of a run are too far apart for means over its swings."""
    refined = 1
    while refined * rows < IN_A_SWING * swings and 2 * refined * rows <= MOST_ROWS:
        refined *= 2
    return refined


def finer(chosen: Simulation, refined: int) -> Simulation:
    """The settings with rows `refined` times as close."""
    if refined == 1:
        return chosen
    if chosen.output_step is not None:
        return dataclasses.replace(chosen, output_step=chosen.output_step / refined)
    return dataclasses.replace(chosen, samples=(chosen.samples - 1) * refined + 1)


def spaced(count: int, every: int) -> npt.NDArray[np.int64]:
    """Every so many of `count` rows, and the last."""
    indices = np.arange(0, count, every)
    return indices if indices[-1] == count - 1 else np.append(indices, count - 1)


class _StiffRuns:
    """A constrained run without outputs and events, and the stiff runs beside it.

    The constrained one: times (T,) and lambda (T,) on a grid `refined` times as fine as that of the rows, omega/sqrt(k)
    of the swing of the row, and what lambda is off by at the rows, by the tolerance.
    """

    def __init__(self, model: Model, chosen: Simulation, index: int, plan: LimitPlan) -> None:
        """Raises `run_stop.RunStop` where the constrained run stops."""
        self._plan, self._settings = plan, chosen
        bare = dataclasses.replace(model, outputs=(), events=(), fingerprint=f"{model.fingerprint} bare")
        run = prepare_run.start(bare, chosen)
        start, numeric, built = run.begin, run.numeric, run.built
        solved = numeric.keeping(run.report.selection).solved
        lam, rate = stiff_system.multiplier_rate(solved, (start.t, start.q, start.v, start.p), index)
        self._row, self._start = StiffRow(index, lam, rate), start
        self._frequency = stiff_system.frequency(numeric, start, index)
        self._rows = run.grid.count - 1
        self._refinement = refinement(self._rows, self._swings(plan.stiffness[-1]))
        if self._refinement > 1:
            run = prepare_run.start(bare, finer(chosen, self._refinement))
        self._bare, self._numeric, self._bodies = run.model, run.numeric, run.built.bodies
        self._name = built.rows.rows[index].name

        def multiplier(run: SimulationRun) -> Floats:
            """The times and lambda of the row, (2, T)."""
            column = run.columns.index(f"lambda.{self._name}")
            blocks = [np.zeros((0, 2)), *(block[:, [0, column]].copy() for block in run.blocks())]
            return np.concatenate(blocks).T

        self._t, self._multiplier = multiplier(run)
        again = multiplier(prepare_run.start(bare, looser(chosen)))[1]
        self._uncertainty = np.abs(again - self.at(1)[1]) / LARGER
        self._ready: CompiledModel | None = None
        self._stretch = stiff_system.stretch(run.built, index)
        self._size = stiff_system.size_of_terms(run.built, index, start)

    def at(self, refined: int) -> tuple[Floats, Floats]:
        """Times and lambda on a grid that is `refined` times as fine as that of the rows."""
        rows = spaced(len(self._t), self._refinement // refined)
        return self._t[rows], self._multiplier[rows]

    def ladder(self, empty: StiffLimit) -> StiffLimit:
        """One run for each stiffness, from the least on, as far as their errors can be resolved."""
        plan, rate_of = self._plan, empty.rate_of
        rungs: list[Rung] = []
        ended = stopped = ""
        soft: list[str] = []
        timed: tuple[float, _Followed] | None = None
        for k in plan.stiffness:
            if ended := self._predicted_too_small(rungs, k):
                break
            if k == plan.stiffness[-1]:
                swings = self._swings(k)
                head = f"the stiffest run, k = {k:.4g}, swings {swings:.3g} times and takes some"
                cost = f"{max(10.0, STEPS_IN_A_SWING * swings):.2g} steps"
                if timed is not None:
                    times = math.sqrt(k / timed[0])
                    # The run is made again with a larger tolerance, in fewer steps.
                    seconds = 1.6 * times * timed[1].seconds
                    cost = f"{times * timed[1].steps:.2g} steps, {seconds:.2g} s at the pace so far"
                plan.report(f"{head} {cost}")
            try:
                followed = self._follow(Stiffness(k))
            except stiff_system.NoSlowStartError:
                soft.append(f"k = {k:.4g}")
                continue
            except run_stop.RunStop as stop:
                stopped = f"the run of k = {k:.4g} stopped at t = {stop.stop.t:.9g}: {stop.stop.reason}"
                break
            timed = k, followed
            rung = self._rung(k, followed)
            ended = self._lost_in_uncertainty(rung, rate_of)
            if not ended or not rungs:
                rungs.append(rung)
            if ended:
                break
        reason = f"no configuration near the start is stretched by -lambda/k at {', '.join(soft)}: too soft a spring"
        known = [(one.stiffness, error) for one in rungs if (error := one.as_json()[rate_of]) is not None]
        return dataclasses.replace(
            empty,
            rungs=tuple(rungs),
            rate=stiff_ladder.fitted([k for k, _ in known], [error for _, error in known]),
            ended=ended,
            steps=sum(one.steps or 0 for one in rungs),
            notes=(reason,) if soft else (),
            stopped=stopped,
        )

    def ramp(self, empty: StiffLimit) -> StiffLimit:
        """One run in which k rises by one factor in equal times. Raises `run_stop.RunStop`."""
        plan, seconds = self._plan, self._settings.duration
        low, high = plan.stiffness[0], plan.stiffness[-1]
        k = Stiffness(low, math.log(high / low) / seconds, self._start.t)
        swings = (self._swings(k.least * math.exp(k.growth * seconds)) - self._swings(k.least)) * 2
        swings /= k.growth * seconds
        plan.report(
            f"the run swings {swings:.3g} times and takes some {max(10.0, STEPS_IN_A_SWING * swings):.2g} steps"
        )
        followed = self._follow(k)
        refined = self._refined(high)
        t, multiplier = self.at(refined)
        stiffness, error = k.at(t), followed.force - multiplier
        rows = spaced(len(t), refined)
        rungs = []
        for least, most in zip(plan.stiffness[:-1], plan.stiffness[1:], strict=True):
            inside = (stiffness >= least * (1 - 1e-12)) & (stiffness <= most * (1 + 1e-12))
            near = (stiffness[rows] >= least) & (stiffness[rows] <= most)
            if inside.sum() < 2:
                continue
            means = self._means(t[inside], error[inside], followed)
            own = float(followed.uncertainty[near].max(initial=0.0))
            middle = math.sqrt(least * most)
            largest = float(np.abs(error[inside]).max())
            rungs.append(Rung(middle, largest, *means, None, own, followed.force[inside]))
        # The mean of a stretch is that of the swings which the soft spring began: no power of k fits it.
        return dataclasses.replace(
            empty,
            t=t[rows],
            multiplier=multiplier[rows],
            rungs=tuple(rungs),
            ramp={"seconds": seconds, "from": low, "to": high, "steps": float(followed.steps)},
            stiffness=stiffness[rows],
            force=followed.force[rows],
            steps=followed.steps,
            notes=(NO_RATE,),
        )

    def _means(self, t: Floats, error: Floats, followed: _Followed) -> tuple[float, float, float]:
        """|The time mean of an error|, how far it is off at most, and |the mean without swings|."""
        mean, apart = stiff_ladder.time_mean(t, error)
        uncertainty = followed.uncertainty + self._uncertainty
        return abs(mean), apart + float(uncertainty.mean()), abs(stiff_ladder.mean_without_swings(t, error))

    def _rung(self, k: float, followed: _Followed) -> Rung:
        refined = self._refined(k)
        t, multiplier = self.at(refined)
        error = followed.force - multiplier
        rows = spaced(len(t), refined)
        means: tuple[float | None, float | None, float | None] = (None, None, None)
        if len(t) - 1 >= IN_A_SWING / 2 * self._swings(k):
            means = self._means(t, error, followed)
        if self._swings(k) < stiff_ladder.FEWEST_SWINGS:
            means = (*means[:2], None)
        largest = float(np.abs(error[rows]).max())
        uncertainty = float(followed.uncertainty.max(initial=0.0))
        return Rung(k, largest, *means, followed.steps, uncertainty, followed.force[rows])

    def _swings(self, k: float) -> float:
        """Swings of the row in the duration of the run."""
        return self._frequency * math.sqrt(k) * self._settings.duration / (2 * math.pi)

    def _refined(self, k: float) -> int:
        rows = (len(self._t) - 1) // self._refinement
        return min(self._refinement, refinement(max(1, rows), self._swings(k)))

    def _follow(self, k: Stiffness) -> _Followed:
        """The run of a stiffness, and again with a larger tolerance. Raises `run_stop.RunStop`, `NoSlowStartError`."""
        refined = self._refined(k.least * math.exp(k.growth * self._settings.duration))
        q, v = self._start.q, self._start.v
        if not self._plan.unprestressed:
            rate = self._row.rate - self._row.multiplier * k.growth
            row = dataclasses.replace(self._row, rate=rate)
            q, v = stiff_system.stretched(self._numeric, self._start, row, k.least)
        force, steps, seconds = self._force(k, (q, v), finer(self._settings, refined))
        again, _, _ = self._force(k, (q, v), looser(self._settings))
        of_rounding = 4 * doubles.EPS * self._size * k.at(self.at(1)[0])
        uncertainty = np.abs(again - force[spaced(len(force), refined)]) / LARGER + of_rounding
        return _Followed(force, steps, seconds, uncertainty)

    def _force(
        self, k: Stiffness, begin: tuple[Floats, Floats], settings: Simulation
    ) -> tuple[Floats, int, float]:
        """-k f (T,) of a run from q, v, its accepted steps, and seconds. Raises `run_stop.RunStop`."""
        bare = dataclasses.replace(self._bare, simulation=settings)
        model = stiff_system.model(bare, self._name, (self._start.t, *begin), k)
        ready = None if self._ready is None else self._ready.with_values(model)
        if ready is None:
            ready = CompiledModel(stiff_system.build(model, self._name, self._plan.is_ramp))
        self._ready = ready
        # The lengths of rigid bodies are those of the constrained start, not those of the stretched one.
        ready = ready.of(dataclasses.replace(ready.system, bodies=self._bodies))
        began = time.perf_counter()
        run = prepare_run.start_compiled(ready, KnownIntegrals())
        states = table_columns.States(model, run.columns)
        found = [np.zeros(0)]
        for block in run.blocks():
            if len(block):
                t, q, _ = states(block)
                f = np.array(self._stretch(t[None], q.T, self._start.p)).ravel()
                found.append(-k.at(t) * f)
        return np.concatenate(found), run.stats.steps, time.perf_counter() - began

    def _lost_in_uncertainty(self, rung: Rung, rate_of: str) -> str:
        """The reason to end the ladder with a run whose error is below its uncertainty, or an empty text."""
        error = rung.as_json()[rate_of]
        if error is None and rung.mean_error is not None:
            return ""
        if error is None:
            return f"at k = {rung.stiffness:.4g} the swings are too many for a mean"
        if rung.uncertainty <= stiff_ladder.UNCERTAIN * error:
            return ""
        return (
            f"at k = {rung.stiffness:.4g} tolerance and rounding make the force uncertain by {rung.uncertainty:.2g},"
            f" more than a tenth of its error {error:.2g}"
        )

    def _predicted_too_small(self, rungs: list[Rung], k: float) -> str:
        """The reason not to begin a run whose error would be below its uncertainty, or an empty text."""
        if len(rungs) < 2 or self._plan.unprestressed:
            return ""
        one, last = rungs[-2:]
        if not (one.uncertainty > 0 and last.uncertainty > 0 and one.max_error > 0 and last.max_error > 0):
            return ""
        step = math.log(k / last.stiffness) / math.log(last.stiffness / one.stiffness)
        uncertainty = last.uncertainty * max(1.0, last.uncertainty / one.uncertainty) ** step
        error = last.max_error * (last.max_error / one.max_error) ** step
        if uncertainty <= error:
            return ""
        return (
            f"at k = {k:.4g} tolerance and rounding would make the force uncertain by {uncertainty:.1g}, more than its"
            f" error {error:.1g}: that run was not begun"
        )
