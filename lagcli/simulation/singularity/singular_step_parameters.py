"""The numbers of a step across a singular configuration (`singularity_step`).

Each says what failed in `tests/physics/test_crossing.py` when it was moved as far as is told; where nothing is told it
was not moved.
"""

from __future__ import annotations


class SingularStepParameters:
    """Parts are of no unit; a distance delta is the angle between rows, in radians."""

    __slots__ = ()

    nodes: int = 10
    """Gauss nodes of the step, even: no node lies in the middle, where the instant is.
    At 6 `test_the_double_four_bar_goes_through_ten_crossings_at_every_tolerance` fails."""
    fewer_nodes: int = 8
    """Nodes of the step it is compared with; the difference is the estimate of its error.
    No test of crossings fails at 4."""
    roundoff: float = 1e-13
    """What a step of this many nodes loses by rounding, as part of the sizes."""
    amplified_roundoff: float = 2e-17
    """Over delta**3 the rounding of forces close to dependent rows: a step is as right as can be where it is this
    exact.
    No test of crossings fails at 2e-12."""
    worst: float = 1e-9
    """However close the rows are to dependent ones, a step must be right to this part of the sizes.
    At 1e-13 `test_the_double_four_bar_goes_through_ten_crossings_at_every_tolerance` fails."""
    centered: float = 0.04
    """The instant is found again until it is off by this part of the time up to it."""
    most_centerings: int = 6
    """Looks for the instant before an ordinary step goes on."""
    places: tuple[float, ...] = (0.5, 0.13, 0.35, 0.04, 0.22)
    """Parts of a step at which the instant may lie: in its middle, or between the first nodes.
    With the middle alone `test_a_crossing_soon_after_the_start` fails."""
    too_close: float = 0.03
    """The angle (rad) below which a step begins so close that all places are tried."""
    far: tuple[float, float] = (0.15, 0.3)
    """Points beside the instant, as parts of twice the time up to it, where the clearance is read first."""
    close: tuple[float, float] = (0.02, 0.04)
    """The same closer by, about the zero that the first have found."""
    closest: tuple[float, float] = (0.001, 0.002)
    """The same once more, where rows can be followed so close: what a cubic leaves out falls with the fourth power.
    Without it `test_a_contact_whose_multiplier_has_a_pole_opens_there` fails."""
    bent: float = 0.1
    """The clearance is a line through zero there, but for this part.
    At 0.001 `test_a_crossing_soon_after_the_start` fails."""
    zero_steps: int = 6
    """Newton's steps for the zero of a cubic that is nearly a line: each doubles the digits, from one or more.
    No test of crossings fails at 1."""
    along_step: tuple[float, ...] = (0.02, 0.2, 0.4, 0.6, 0.8, 0.9)
    """Parts of the time to the instant where the clearance must fall, and rise again after it."""
    halvings: int = 30
    """A step from a singular start is halved at most so often.
    No test of crossings fails at 1."""
    same_velocity: float = 1e-5
    """The velocities of such a step at its begin are those of the start to this part.
    At 1e-14 `test_a_start_at_a_crossing_goes_on_along_the_branch_of_its_velocities` fails."""


PARAMETERS = SingularStepParameters()
