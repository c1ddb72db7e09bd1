"""Redundant rows at a regular point: on the smooth surface that some of them cut out the others vanish.

Then f = 0 is that surface, its codimension is the rank of B, and the multiplier rule (D.13-D.22) holds: there are
multipliers for the force that the surface needs, though not single ones.
"""

from __future__ import annotations

from collections.abc import Sequence

from lagcli.analysis.codimension import manifold
from lagcli.analysis.codimension.scaled_equations import ScaledPart


def is_regular(part: ScaledPart, rank: int, times: Sequence[float]) -> bool:
    """True if rows of this rank at their begin cut out a surface of that codimension, and do so at other times."""
    t = part.state.t
    if not part.coordinates:  # 0 = 0, the empty component of a vector equation
        return all(not part.at(part.begin, time)[0].any() for time in (t, *times))
    found = manifold.along(part, part.begin, t, rank)
    return found is not None and manifold.is_whole(found, part.begin, t, times)
