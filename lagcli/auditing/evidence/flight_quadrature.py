"""Velocities and places at the end of a flight by accelerations at five places of it: Boole's formula on the quintic
curve through places, velocities and accelerations at both ends (Hermite)."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable

import numpy as np

from lagcli.auditing.evidence.autodiff import Array
from lagcli.auditing.evidence.table_input import Record

# A formula of the fourth order knows by so many times what one of the second one is off how far off it is.
CAREFUL = 4.0
# Fourth differences that are this part of the second ones, or more, are of no smooth acceleration: it bends or jumps.
ROUGH = 0.25


@dataclasses.dataclass(frozen=True, slots=True, eq=False)
class FlightIntegrals:
    """Of P flights: changes of velocities, and of places beyond h (v + v')/2, (P, n) each, with what is not known of
    them; and states halfway with their accelerations."""

    velocities: Array
    unknown_velocities: Array
    places: Array
    unknown_places: Array
    middle: Record
    acceleration: Array


def integrals(one: Record, other: Record, accelerations: Callable[[Record], Array]) -> FlightIntegrals:
    """Those from states to states later; `accelerations` (P, n) of states."""
    h = (other.t - one.t)[:, None]
    begin, end = accelerations(one), accelerations(other)
    inner = [_between(one, other, (begin, end), u) for u in (0.25, 0.5, 0.75)]
    a = np.stack([begin, *(accelerations(r) for r in inner), end])
    boole = h / 90 * (7 * (a[0] + a[4]) + 32 * (a[1] + a[3]) + 12 * a[2])
    simpson = h / 6 * (a[0] + 4 * a[2] + a[4])
    # The integrals of (h/2 - s) a(s) ds.
    bend = h * h / 90 * (3.5 * (a[0] - a[4]) + 8 * (a[1] - a[3]))
    plain = h * h / 12 * (a[0] - a[4])
    second, fourth = np.abs(np.diff(a, n=2, axis=0)).max(axis=0), np.abs(np.diff(a, n=4, axis=0))[0]
    rough = fourth >= ROUGH * second
    return FlightIntegrals(
        boole,
        CAREFUL * np.abs(boole - simpson) + np.where(rough, np.abs(simpson - h / 2 * (a[0] + a[4])), 0.0),
        bend,
        CAREFUL * np.abs(bend - plain) + np.where(rough, np.abs(plain), 0.0),
        inner[1],
        a[2],
    )


def _between(one: Record, other: Record, ends: tuple[Array, Array], u: float) -> Record:
    """The states at the part u of the way, on the quintic curve."""
    h = (other.t - one.t)[:, None]
    (v, w), (a, b) = (h * one.v, h * other.v), (h * h * ends[0], h * h * ends[1])
    rise = other.q - one.q
    s, p, r = u**2, u**3, u**4
    x = 10 * p - 15 * r + 6 * u * r
    q = (
        one.q
        + rise * x
        + v * (u - 6 * p + 8 * r - 3 * u * r)
        + w * (-4 * p + 7 * r - 3 * u * r)
        + a * (s - 3 * p + 3 * r - u * r) / 2
        + b * (p - 2 * r + u * r) / 2
    )
    rate = (
        rise * (30 * s - 60 * p + 30 * r)
        + v * (1 - 18 * s + 32 * p - 15 * r)
        + w * (-12 * s + 28 * p - 15 * r)
        + a * (2 * u - 9 * s + 12 * p - 5 * r) / 2
        + b * (3 * s - 8 * p + 5 * r) / 2
    )
    return dataclasses.replace(one, t=one.t + u * (other.t - one.t), q=q, v=rate / h)
