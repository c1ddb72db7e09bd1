"""The stiff runs of `lagcli.limit`: one for each stiffness, or one in which it rises."""

from __future__ import annotations

import dataclasses
import math
import time

import numpy as np
import numpy.typing as npt

from lagcli import doubles
from lagcli.analysis.classification.verdict import KnownIntegrals
from lagcli.api import constrained_run
from lagcli.api.constrained_run import IN_A_SWING, Constrained, LimitPlan
from lagcli.api.models.cache import CompiledModel
from lagcli.api.runs import prepare_run
from lagcli.formulations import stiff_ladder, stiff_system
from lagcli.formulations.stiff_ladder import Rung, StiffLimit
from lagcli.formulations.stiff_system import Stiffness
from lagcli.model.model import Model
from lagcli.model.settings import Simulation
from lagcli.running import table_columns
from lagcli.simulation.run_state import run_stop

Floats = npt.NDArray[np.float64]

# Steps of a swing at the usual tolerance: an estimate until the first run has been made.
STEPS_IN_A_SWING = 12.0
NO_RATE = "of a ramp no rate is fitted: its errors are swings that the soft spring began, and they keep their action"


@dataclasses.dataclass(frozen=True, slots=True, eq=False)
class _Followed:
    """A stiff run: -k f (T,) on its grid, accepted steps, seconds, the uncertainty of the force (rows,) at the rows."""

    force: Floats
    steps: int
    seconds: float
    uncertainty: Floats


def limit(model: Model, chosen: Simulation, plan: LimitPlan) -> StiffLimit:
    """The limit of one row. Raises `diagnostics.ModelError`, `ValueError`."""
    constrained, row, notes = constrained_run.constrained(model, chosen, plan)
    kind = "unprestressed" if plan.unprestressed else "adapted"
    if isinstance(constrained, str):
        nothing = np.zeros(0)
        rate_of = "weighted_mean" if plan.unprestressed or plan.is_ramp else "max_error"
        return StiffLimit(model.path, row, kind, nothing, nothing, (), None, rate_of, stopped=constrained)
    runs = _StiffRuns(constrained, row, plan)
    try:
        found = runs.ramp(kind) if plan.is_ramp else runs.ladder(kind)
    except run_stop.RunStop as stop:
        t, multiplier = constrained.at(1)
        reason = f"the stiff run stopped at t = {stop.stop.t:.9g}: {stop.stop.reason}"
        found = StiffLimit(model.path, row, kind, t, multiplier, (), None, "weighted_mean", stopped=reason)
    return dataclasses.replace(found, notes=(*notes, *found.notes))


def _means(t: Floats, error: Floats, uncertainty: Floats) -> tuple[float, float, float]:
    """|The time mean of an error|, how far it is off at most, and |the mean without swings|; uncertainty: of the error
    at rows."""
    mean, apart = stiff_ladder.time_mean(t, error)
    return abs(mean), apart + float(uncertainty.mean()), abs(stiff_ladder.mean_without_swings(t, error))


class _StiffRuns:
    """The stiff runs beside a constrained one."""

    def __init__(self, constrained: Constrained, row: str, plan: LimitPlan) -> None:
        self._constrained, self._row, self._plan = constrained, row, plan
        self._ready: CompiledModel | None = None
        built = constrained.run.built
        self._stretch = stiff_system.stretch(built, constrained.row.index)
        self._size = stiff_system.size_of_terms(built, constrained.row.index, constrained.start)

    def ladder(self, kind: str) -> StiffLimit:
        """One run for each stiffness, from the least on, as far as their errors can be resolved."""
        constrained, plan = self._constrained, self._plan
        rate_of = "weighted_mean" if plan.unprestressed else "max_error"
        rungs: list[Rung] = []
        ended = stopped = ""
        soft: list[str] = []
        timed: tuple[float, _Followed] | None = None
        for k in plan.stiffness:
            if ended := self._predicted_too_small(rungs, k):
                break
            if k == plan.stiffness[-1]:
                plan.report(self._forecast(k, timed))
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
        t, multiplier = constrained.at(1)
        reason = f"no configuration near the start is stretched by -lambda/k at {', '.join(soft)}: too soft a spring"
        known = [(one.stiffness, error) for one in rungs if (error := one.error(rate_of)) is not None]
        rate = stiff_ladder.fitted([k for k, _ in known], [error for _, error in known])
        return StiffLimit(
            constrained.run.model.path, self._row, kind, t, multiplier, tuple(rungs), rate, rate_of, ended,
            steps=sum(one.steps or 0 for one in rungs), notes=(reason,) if soft else (), stopped=stopped,
        )  # fmt: skip

    def ramp(self, kind: str) -> StiffLimit:
        """One run in which k rises by one factor in equal times. Raises `run_stop.RunStop`."""
        constrained, plan = self._constrained, self._plan
        low, high = plan.stiffness[0], plan.stiffness[-1]
        seconds = constrained.settings.duration
        k = Stiffness(low, math.log(high / low) / seconds, constrained.start.t)
        swings = (self._swings(k.least * math.exp(k.growth * seconds)) - self._swings(k.least)) * 2
        swings /= k.growth * seconds
        plan.report(f"the run swings {swings:.3g} times and takes some {self._steps(swings):.2g} steps")
        followed = self._follow(k)
        refined = self._refined(high)
        t, multiplier = constrained.at(refined)
        stiffness, error = k.at(t), followed.force - multiplier
        rows = constrained_run.spaced(len(t), refined)
        rungs = []
        for least, most in zip(plan.stiffness[:-1], plan.stiffness[1:], strict=True):
            inside = (stiffness >= least * (1 - 1e-12)) & (stiffness <= most * (1 + 1e-12))
            near = (stiffness[rows] >= least) & (stiffness[rows] <= most)
            if inside.sum() < 2:
                continue
            means = _means(t[inside], error[inside], followed.uncertainty + constrained.uncertainty)
            own = float(followed.uncertainty[near].max(initial=0.0))
            middle = math.sqrt(least * most)
            largest = float(np.abs(error[inside]).max())
            rungs.append(Rung(middle, largest, *means, None, own, followed.force[inside]))
        # The mean of a stretch is that of the swings which the soft spring began: no power of k fits it.
        return StiffLimit(
            constrained.run.model.path, self._row, kind, t[rows], multiplier[rows], tuple(rungs), None, "weighted_mean",
            ramp={"seconds": seconds, "from": low, "to": high, "steps": float(followed.steps)},
            stiffness=stiffness[rows], force=followed.force[rows], steps=followed.steps, notes=(NO_RATE,),
        )  # fmt: skip

    def _rung(self, k: float, followed: _Followed) -> Rung:
        refined = self._refined(k)
        t, multiplier = self._constrained.at(refined)
        error = followed.force - multiplier
        rows = constrained_run.spaced(len(t), refined)
        means: tuple[float | None, float | None, float | None] = (None, None, None)
        if len(t) - 1 >= IN_A_SWING / 2 * self._swings(k):
            means = _means(t, error, followed.uncertainty + self._constrained.uncertainty)
        if self._swings(k) < stiff_ladder.PARAMETERS.fewest_swings:
            means = (*means[:2], None)
        largest = float(np.abs(error[rows]).max())
        uncertainty = float(followed.uncertainty.max(initial=0.0))
        return Rung(k, largest, *means, followed.steps, uncertainty, followed.force[rows])

    def _swings(self, k: float) -> float:
        """Swings of the row in the duration of the run."""
        return (
            self._constrained.frequency * math.sqrt(k) * self._constrained.settings.duration / (2 * math.pi)
        )

    def _refined(self, k: float) -> int:
        rows = (len(self._constrained.t) - 1) // self._constrained.refined
        return min(self._constrained.refined, constrained_run.refinement(max(1, rows), self._swings(k)))

    def _follow(self, k: Stiffness) -> _Followed:
        """The run of a stiffness, and again with a larger tolerance. Raises `run_stop.RunStop`, `NoSlowStartError`."""
        constrained, plan = self._constrained, self._plan
        most = k.least * math.exp(k.growth * constrained.settings.duration)
        refined = self._refined(most)
        q, v = constrained.start.q, constrained.start.v
        if not plan.unprestressed:
            rate = constrained.row.rate - constrained.row.multiplier * k.growth
            row = dataclasses.replace(constrained.row, rate=rate)
            q, v = stiff_system.stretched(constrained.run.numeric, constrained.start, row, k.least)
        settings = constrained_run.finer(constrained.settings, refined)
        force, steps, seconds = self._force(k, (q, v), settings)
        again, _, _ = self._force(k, (q, v), constrained_run.looser(constrained.settings))
        rows = constrained_run.spaced(len(force), refined)
        t = constrained.at(1)[0]
        uncertainty = np.abs(
            again - force[rows]
        ) / constrained_run.LARGER + 4 * doubles.EPS * self._size * k.at(t)
        return _Followed(force, steps, seconds, uncertainty)

    def _force(
        self, k: Stiffness, begin: tuple[Floats, Floats], settings: Simulation
    ) -> tuple[Floats, int, float]:
        """-k f (T,) of a run from q, v, its accepted steps, and seconds. Raises `run_stop.RunStop`."""
        constrained = self._constrained
        bare = dataclasses.replace(constrained.run.model, simulation=settings)
        model = stiff_system.model(bare, self._row, (constrained.start.t, *begin), k)
        ready = None if self._ready is None else self._ready.with_values(model)
        if ready is None:
            ready = CompiledModel(stiff_system.build(model, self._row, self._plan.is_ramp))
        self._ready = ready
        # The lengths of rigid bodies are those of the constrained start, not those of the stretched one.
        ready = ready.of(dataclasses.replace(ready.system, bodies=constrained.run.built.bodies))
        began = time.perf_counter()
        run = prepare_run.start_compiled(ready, KnownIntegrals())
        states = table_columns.States(model, run.columns)
        found = [np.zeros(0)]
        for block in run.blocks():
            if len(block):
                t, q, _ = states(block)
                f = np.array(self._stretch(t[None], q.T, constrained.start.p)).ravel()
                found.append(-k.at(t) * f)
        return np.concatenate(found), run.stats.steps, time.perf_counter() - began

    def _lost_in_uncertainty(self, rung: Rung, rate_of: str) -> str:
        """The reason to end the ladder with a run whose error is below its uncertainty, or an empty text."""
        error = rung.error(rate_of)
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

    def _forecast(self, k: float, timed: tuple[float, _Followed] | None) -> str:
        swings = self._swings(k)
        head = f"the stiffest run, k = {k:.4g}, swings {swings:.3g} times"
        if timed is None:
            return f"{head} and takes some {self._steps(swings):.2g} steps"
        before, followed = timed
        times = math.sqrt(k / before)
        # The run is made again with a larger tolerance, in fewer steps.
        seconds = 1.6 * times * followed.seconds
        return f"{head} and takes some {times * followed.steps:.2g} steps, {seconds:.2g} s at the pace so far"

    def _steps(self, swings: float) -> float:
        return max(10.0, STEPS_IN_A_SWING * swings)
