"""First integrals of differential constraints, phi(r, q, t) = const, as texts in the notation of the model."""

from __future__ import annotations

from lagcli.frozen import frozen_value


@frozen_value
class LevelFunction:
    """A way to hold an integral without a pole or a jump: above/below is phi or a monotone function of it.

    Both are finite wherever the chart serves: above * below(0) - below * above(0) stays zero, also where `below`
    vanishes. `period`: phi jumps by multiples of it where an atan2 crosses its cut; then `below` is "1".
    """

    above: str
    below: str = "1"
    period: str | None = None


@frozen_value
class FirstIntegral:
    """phi as it is shown, the differential rows whose combination it integrates, and charts, the best first. Without a
    chart the integral is known and not enforced: the velocity row alone keeps it."""

    text: str
    rows: tuple[str, ...]
    charts: tuple[LevelFunction, ...] = ()
