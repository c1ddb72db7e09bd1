"""The work W over a step whose stages were too few for it.

W does not steer the motion, and steps may be so long that the power W' of rows and forces oscillates within one. The
motion is known there, so that W is the integral of a known function: panels of Gauss, the one with the largest error
halved first.
"""

from __future__ import annotations

import bisect
import heapq
from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from lagcli import doubles
from lagcli.arrays import Floats
from lagcli.compiled.bound_function import BoundFunction
from lagcli.simulation.scheme import collocation
from lagcli.simulation.scheme.collocation import Step

Powers = Callable[[Floats], tuple[Floats, float] | None]


class WorkParameters:
    """Panels of the work of a step, and the error with which it is known; parts are of no unit. The tests are of
    `tests/unit/test_numbers_of_schemes.py`."""

    __slots__ = ()

    nodes: int = 12
    """Nodes of a panel: a wave takes about one panel to rounding. `test_a_panel_has_twelve_nodes`."""
    most_panels: int = 2048
    """Panels of a step: some thousand waves, at the cost of ten thousand steps. `test_a_power_of_noise_is_given_up`."""
    gain: float = 4.0
    """An error that is not divided by this, though small, is rounding: else by 2^12.
    `test_an_error_that_stays_and_is_small_is_rounding`."""
    doubted: float = 100.0
    """It is off by so many tolerances of a step, and a millionth of the energy, at most.
    `test_work_is_known_to_six_digits`."""


PARAMETERS = WorkParameters()


class _Panel(NamedTuple):
    """Sorted by its error, the largest first, then by its begin; work: the integral with W = 0 at its begin."""

    rank: float
    begin: float
    work: Step

    @property
    def error(self) -> float:
        return -self.rank


class Work:
    """W within a step as panels one after the other, each a polynomial; end: W at the end of the step."""

    def __init__(self, panels: list[Step], start: float) -> None:
        """panels: each with W = 0 at its begin; start: W at the begin of the step."""
        self._panels, self._begins, self.end = [], [panel.t for panel in panels], start
        for panel in panels:
            self._panels.append(Step(panel.t, panel.h, np.array([self.end]), panel.slopes))
            self.end = float(self._panels[-1].state(1.0)[0])

    def at(self, t: float) -> float:
        """W at a time within the step."""
        panel = self._panels[max(0, bisect.bisect_right(self._begins, t) - 1)]
        return float(panel.state((t - panel.t) / panel.h)[0])


def within(
    project: BoundFunction, span: tuple[float, float, float], y: Floats, states: Callable[[Floats], Floats]
) -> Work | None:
    """W within an ordinary step from y, beginning at y[-1]; None where it is not found. project:
    `NumericSystem.project` on arrays (t, y, p) of its own; span: t, h and the relative tolerance of a step; states(x
    (k,)) -> the dense output at fractions of the step (k, 2n + 1)."""
    t, h, rtol = span
    n = y.size // 2

    def projected(times: Floats, configurations: Floats) -> tuple[Floats, float] | None:
        found, energy = np.empty(times.size), 0.0
        for i, (at, state) in enumerate(zip(times.tolist(), configurations, strict=True)):
            rate = collocation.projected(project, at, state)
            if rate is None:
                return None
            found[i] = rate[-1]
            energy = max(energy, float(project.results[3][n + 1]) ** 2)
        return found, energy

    def powers(times: Floats) -> tuple[Floats, float] | None:
        return projected(times, states((times - t) / h))

    def perturbed(times: Floats) -> tuple[Floats, float] | None:
        # States and times moved by two roundings show that of a power whose terms cancel.
        part = 2 * doubles.EPS
        signs = np.where(np.arange(2 * n + 1) % 2, -part, part)
        return projected(times + part * (abs(t) + h), states((times - t) / h) * (1 + signs))

    return WorkIntegral(powers, rtol, perturbed).over(t, h, float(y[-1]))


class WorkIntegral:
    """The integral of a power over a step, to a relative tolerance of the energies at hand. powers(times (k,)) -> the
    power at each (k,), and an energy such as the largest of the motion there, or None; perturbed: the same at states
    that are moved by their rounding."""

    def __init__(self, powers: Powers, rtol: float, perturbed: Powers | None = None) -> None:
        self._powers, self._rtol, self._perturbed = powers, rtol, perturbed
        self._nodes = collocation.gauss(PARAMETERS.nodes)[0]
        self._energy = 0.0
        self._rounding = 0.0  # of the power

    def over(self, t: float, h: float, start: float) -> Work | None:
        """W over a step from t to t + h with a value at its begin; None where it is not found."""
        self._energy = abs(start)
        whole = self._panel(t, h)
        if whole is None:
            return None
        moved = None if self._perturbed is None else self._perturbed(t + self._nodes * h)
        if moved is not None:
            self._rounding = float(np.abs(moved[0] - whole.slopes[:, 0]).max())
        waiting = [_Panel(-np.inf, t, whole)]
        done: list[_Panel] = []
        for count in range(1, PARAMETERS.most_panels):
            if not waiting or waiting[0].error * count <= self._rtol * self._energy:
                break
            halves = self._halved(heapq.heappop(waiting))
            if halves is None:
                return None
            for half, is_done in halves:
                if is_done:
                    done.append(half)
                else:
                    heapq.heappush(waiting, half)
        panels = sorted((*waiting, *done), key=lambda panel: panel.begin)
        known = max(doubles.ROOT, PARAMETERS.doubted * self._rtol) * self._energy + self._rounding * h
        if sum(panel.error for panel in panels) > known:
            return None
        return Work([panel.work for panel in panels], start)

    def _halved(self, panel: _Panel) -> list[tuple[_Panel, bool]] | None:
        """Both halves of a panel, and whether an error is down to rounding."""
        whole, h = panel.work, panel.work.h / 2
        first, second = self._panel(whole.t, h), self._panel(whole.t + h, h)
        if first is None or second is None:
            return None
        at_middle, at_end = (float(whole.state(x)[0]) for x in (0.5, 1.0))
        error = abs(float(first.state(1.0)[0]) - at_middle)
        error = max(error, abs(float(second.state(1.0)[0]) - (at_end - at_middle)))
        powers = np.concatenate([first.slopes, second.slopes])
        largest = float(np.abs(powers).max())
        seen = (
            4 * doubles.EPS * (abs(whole.t) + whole.h) * float(np.ptp(powers))
            + 4 * doubles.EPS * whole.h * largest
        )
        seen += self._rounding * whole.h
        is_stalled = error > panel.error / PARAMETERS.gain and error < doubles.ROOT * whole.h * largest
        is_done = error <= seen or is_stalled
        return [(_Panel(-error / 2, half.t, half), is_done) for half in (first, second)]

    def _panel(self, t: float, h: float) -> Step | None:
        found = self._powers(t + self._nodes * h)
        if found is None:
            return None
        powers, energy = found
        self._energy = max(self._energy, energy)
        return Step(t, h, np.zeros(1), powers[:, None])
