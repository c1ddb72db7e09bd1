"""A step that was found and is not yet taken, and what an event makes of it: values, so that to take one back is to
forget it."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING, NamedTuple

from lagcli.simulation.run_state.statistics import Incident
from lagcli.simulation.singularity.singularity_monitor import SingularityMonitor

if TYPE_CHECKING:
    from lagcli.equations.energy_jumps import Jump

    # Most runs meet no singular configuration, and in most W needs no integral of its own.
    from lagcli.simulation.scheme.work_integral import Work
    from lagcli.simulation.singularity.singularity_step import SingularStep


class FoundStep(NamedTuple):
    """A step from where the run stands; the states at its end lie in the arrays of the run until another one is tried.

    reached, taken, proposed: its end, its length and the step to be tried after it; watch: what is seen of the rows at
    its end; rejected: steps tried before it; is_jump: its end is an incident, beyond which the state is another;
    is_still: it leads over a switch, where the state stays; singular_step: of one across; work: W within it, where its
    stages were too few, and is_balanced: not where that was not found; barrier: where something jumps, the end of the
    run; within: incidents in it that do not end it; deepest: the largest -g_j at its end; acts: what is done once the
    run stands there; at_end: in place of that where the run ends with it.
    """

    reached: float
    taken: float
    proposed: float
    watch: SingularityMonitor
    rejected: int = 0
    is_jump: bool = False
    is_still: bool = False
    singular_step: SingularStep | None = None
    work: Work | None = None
    is_balanced: bool = True
    barrier: Jump | None = None
    within: tuple[Incident, ...] = ()
    deepest: float = 0.0
    acts: tuple[Callable[[], None], ...] = ()
    at_end: tuple[Callable[[], None], ...] = ()

    @property
    def is_ordinary(self) -> bool:
        """True for a step of the scheme."""
        return not self.is_still and self.singular_step is None


class Cut(NamedTuple):
    """What an event makes of a step: the step as it ends now, or None where it is given up, for what it meets is where
    the run stands; act: what is done once the run stands there; at_end: what is done where the run ends with it."""

    step: FoundStep | None
    act: Callable[[], None] | None = None
    at_end: Callable[[], None] | None = None
