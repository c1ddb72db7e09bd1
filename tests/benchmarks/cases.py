"""The motions that every program computes: model, numbers for the peers, and a reference that is not lagcli's."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from lagcli.running.trajectory import Trajectory

from . import models, networks

Floats = npt.NDArray[np.float64]

# Seconds of motion: long enough for some dozens of steps, short enough for a reference to rounding.
DURATIONS = {3: 5.0, 10: 2.0, 30: 1.0, 100: 1.0, 1000: 0.1, 10000: 0.02}
GALLERY, GALLERY_DURATION = Path(__file__).parents[2] / "models", 6.0
CLOTH_SIDE, CLOTH_DURATION = 30, 0.2

# F. Mazzia, C. Magherini, Test Set for Initial Value Problem Solvers, release 2.4, University of Bari 2008:
# problem Car Axis, reference solution at t = 3, coordinates xl, yl, xr, yr.
AXIS_DURATION = 3.0
AXIS_END = (0.4934557842755629e-1, 0.4969894602303324, 0.1041742524885400e1, 0.3739110272652214)


@dataclasses.dataclass(frozen=True, slots=True)
class Case:
    """A motion: its model file, the numbers the peers take, and q at the end by `reference`.

    `end` takes q from the last row of lagcli's table; `source` says what the reference is.
    """

    part: str
    name: str
    links: int
    model: str
    problem: dict[str, Any]
    end: Callable[[Trajectory], Floats]
    reference: Callable[[], Floats]
    source: str

    @property
    def duration(self) -> float:
        return float(self.problem["duration"])


def _positions(run: Trajectory, network: networks.Network) -> Floats:
    """Positions of the points that move; a held point that is no particle of the model is the origin."""
    count = sum(name.endswith(".vx") for name in run.columns)
    positions = run.rows[-1, 1 : 1 + 6 * count].reshape(count, 6)[:, :3]
    skipped = len(network.points) - count
    return positions[network.free - skipped].ravel()


def _columns(run: Trajectory, names: tuple[str, ...]) -> Floats:
    return np.array([run[name][-1] for name in names])


def chain(links: int, share: float = 1.0) -> Case:
    """A chain of rods written as `distance`; `share` of the usual duration."""
    network, duration = networks.chain(links), share * DURATIONS[links]
    return Case(
        part="chain",
        name=f"chain, {links} links",
        links=links,
        model=models.chain(links, "distance"),
        problem={"kind": "network", "duration": duration, **network.as_json()},
        end=lambda run: _positions(run, network),
        reference=lambda: networks.reference(network, duration),
        source="extrapolation",
    )


def cloth(side: int = CLOTH_SIDE) -> Case:
    """A net of rods, held at two corners."""
    network = networks.cloth(side)
    return Case(
        part="cloth",
        name=f"cloth, {side} x {side}",
        links=len(network.rods),
        model=models.cloth(side),
        problem={"kind": "network", "duration": CLOTH_DURATION, **network.as_json()},
        end=lambda run: _positions(run, network),
        reference=lambda: networks.reference(network, CLOTH_DURATION),
        source="extrapolation",
    )


def disk() -> Case:
    """The rolling disk: circles."""
    duration = 10.0
    a, spin, turn = models.DISK["a"], models.DISK["spin"], models.DISK["turn"]
    radius, angle = a * spin / turn, turn * duration
    end = [radius * (1 - math.cos(angle)), -radius * math.sin(angle), angle, spin * duration]
    return Case(
        part="disk",
        name="rolling disk",
        links=2,
        model=models.disk(),
        problem={"kind": "disk", "duration": duration, **models.DISK},
        end=lambda run: _columns(run, ("x", "y", "theta", "phi")),
        reference=lambda: np.array(end),
        source="closed form",
    )


def _ramp() -> Floats:
    """The knife edge after 6 s: x, y, phi."""
    alpha, w, t = math.pi / 4, math.pi / 3, GALLERY_DURATION
    way = 9.81 * math.sin(alpha) / (2 * w**2)
    return np.array([way * math.sin(w * t) ** 2, way * (w * t - math.sin(2 * w * t) / 2), w * t])


def _axle() -> Floats:
    """The two wheels after 6 s: x, y, theta, phi1, phi2."""
    M, J, a, b, w, t = 3.0, 0.01, 0.2, 0.8, math.pi / 2, GALLERY_DURATION
    pull = M * 9.81 * math.sin(math.pi / 12) / (M + 2 * J / a**2)
    way, angle = pull / (2 * w**2), w * t
    gone = pull * (1 - math.cos(angle)) / w**2
    turned = [(gone + side * b * angle / 2) / a for side in (-1, 1)]
    return np.array([way * math.sin(angle) ** 2, way * (angle - math.sin(2 * angle) / 2), angle, *turned])


def _integrators() -> Floats:
    """The crossed integrators after 6 s: phi, y, z."""
    angle = 0.08 * GALLERY_DURATION**2 / (2 * (0.02 + 0.5 * 0.2**2))
    return np.array([angle, 0.2 * math.cos(angle), 0.2 * math.sin(angle)])


# Nonholonomic models of the gallery beside the rolling disk: their coordinates, and where they end, in closed form.
NONHOLONOMIC: dict[str, tuple[tuple[str, ...], Callable[[], Floats]]] = {
    "knife-edge": (("x", "y", "phi"), _ramp),
    "two-wheel-axle": (("x", "y", "theta", "phi1", "phi2"), _axle),
    "crossed-integrators": (("phi", "y", "z"), _integrators),
}


def nonholonomic(name: str) -> Case:
    """A nonholonomic model of the gallery, which the peers have no equations of."""
    columns, end = NONHOLONOMIC[name]
    text = (GALLERY / f"{name}.yaml").read_text(encoding="utf-8")
    return Case(
        part="nonholonomic",
        name=name.replace("-", " "),
        links=text.split("differential:")[1].split("outputs:")[0].count(" = 0\n"),
        model=text,
        problem={"kind": "nonholonomic", "duration": GALLERY_DURATION},
        end=lambda run: _columns(run, columns),
        reference=end,
        source="closed form",
    )


def axis() -> Case:
    """The car axis."""
    return Case(
        part="axis",
        name="car axis",
        links=2,
        model=models.axis(),
        problem={"kind": "axis", "duration": AXIS_DURATION, **models.AXIS},
        end=lambda run: _columns(run, ("xl", "yl", "xr", "yr")),
        reference=lambda: np.array(AXIS_END),
        source="Test Set for IVP Solvers",
    )


def cases(parts: frozenset[str], largest: int, share: float = 1.0) -> Iterator[Case]:
    """The cases of these parts, chains up to `largest` links and of a `share` of their duration."""
    if "chain" in parts:
        yield from (chain(links, share) for links in DURATIONS if links <= largest)
    if "cloth" in parts and largest >= CLOTH_SIDE:
        yield cloth()
    if "disk" in parts:
        yield disk()
    if "nonholonomic" in parts:
        yield from map(nonholonomic, NONHOLONOMIC)
    if "axis" in parts:
        yield axis()
