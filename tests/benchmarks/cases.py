"""The motions that every program computes: model, numbers for the others, and a reference that is not lagcli's."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from . import collisions, impacts, models, networks

Floats = npt.NDArray[np.float64]

# Spheres that bounce, and seconds of motion with impacts.
SPHERES, SPHERES_DURATION, LANDING_DURATION = 20, 0.4, 0.28
LANDING = """\
lagcli: 1
parameters: {{N: {count}, D: 0.1, g: {gravity}}}
particles:
  p[i]: {{for: "i = 1..N", mass: 1, position: "[i, 0, 0.1 + 0.02*i]"}}
forces:
  weight: {{to: p, force: "[0, 0, -m*g]"}}
inequality:
  floor[i]: {{for: "i = 1..N", condition: "p[i].z >= D/2"}}
"""


class Case(NamedTuple):
    """A motion: its name, what the programs are told (the model and the columns of q for lagcli, numbers for others),
    and q at the end. patience: times the limit that a solution may take."""

    name: str
    problem: dict[str, Any]
    reference: Callable[[], Floats]
    patience: float = 1.0


def _network(name: str, network: networks.Network, duration: float, model: str, columns: list[str]) -> Case:
    problem = {"kind": "network", "duration": duration, **network.as_json(), "model": model}
    return Case(name, problem | {"columns": columns}, lambda: networks.reference(network, duration))


def _plane(name: str, network: networks.Network, duration: float) -> Case:
    columns = [f"{letter}{k}" for k in network.free for letter in "xz"]
    return _network(name, network, duration, models.plane(network), columns)


def chain(links: int, duration: float) -> Case:
    """A chain of rods written as `distance`."""
    columns = [f"p[{k}].{letter}" for k in range(1, links + 1) for letter in "xyz"]
    name = f"chain, {links} links"
    return _network(name, networks.chain(links), duration, models.chain(links, "distance"), columns)


def _disk(duration: float) -> Case:
    """The rolling disk: circles, in closed form."""
    a, spin, turn = models.DISK["a"], models.DISK["spin"], models.DISK["turn"]
    radius, angle = a * spin / turn, turn * duration
    end = [radius * (1 - math.cos(angle)), -radius * math.sin(angle), angle, spin * duration]
    problem = {"kind": "disk", "duration": duration, **models.DISK, "model": models.disk()}
    return Case("rolling disk", problem | {"columns": ["x", "y", "theta", "phi"]}, lambda: np.array(end))


def _spheres() -> Case:
    """Elastic spheres in a cube, in no order, without gravity; from event to event."""
    i = np.arange(SPHERES)
    places = np.stack(
        [0.1 + 0.2 * (i % 5), 0.1 + 0.04 * (i % 25 - i % 5), 0.1 + 0.008 * (i - i % 25)], axis=1
    )
    velocities = np.stack([np.sin(129 * (i + 1)), np.sin(782 * (i + 1)), np.sin(251 * (i + 1) + 2)], axis=1)
    problem = {
        "kind": "spheres",
        "duration": SPHERES_DURATION,
        "model": impacts.spheres().replace("N: 100", f"N: {SPHERES}"),
        "columns": [f"p[{k + 1}].{letter}" for k in i for letter in "xyz"],
        "places": places.tolist(),
        "velocities": velocities.tolist(),
        "diameter": 0.1,
        "restitution": 1.0,
        "gravity": 0.0,
        "meet": True,
        "walls": [
            ([side if axis == k else 0.0 for k in range(3)], [way if axis == k else 0.0 for k in range(3)])
            for axis in range(3)
            for side, way in ((0.0, 1.0), (1.0, -1.0))
        ],
        "steps": [50 * 2**k for k in range(9)],
    }
    return Case(
        f"{SPHERES} spheres that bounce",
        problem,
        lambda: collisions.spheres(places, velocities, (0.1, 1.0), SPHERES_DURATION)[0],
        patience=5.0,
    )


def _landing(count: int = 20) -> Case:
    """Spheres that fall and stay where they land, a few still falling at the end; closed form."""
    places = np.array([[float(k), 0.0, 0.1 + 0.02 * k] for k in range(1, count + 1)])
    model = LANDING.format(count=count, gravity=networks.GRAVITY)
    problem = {
        "kind": "spheres",
        "duration": LANDING_DURATION,
        "model": model,
        "columns": [f"p[{k}].{letter}" for k in range(1, count + 1) for letter in "xyz"],
        "places": places.tolist(),
        "velocities": np.zeros_like(places).tolist(),
        "diameter": 0.1,
        "restitution": 0.0,
        "gravity": networks.GRAVITY,
        "meet": False,
        "walls": [([0.0, 0.0, 0.0], [0.0, 0.0, 1.0])],
        "steps": [50 * 2**k for k in range(9)],
    }
    end = places.copy()
    end[:, 2] = np.maximum(places[:, 2] - networks.GRAVITY * LANDING_DURATION**2 / 2, 0.05)
    return Case(f"{count} spheres that land", problem, end.ravel, patience=5.0)


CASES: dict[str, Callable[[], Case]] = {
    "pendulum": lambda: _plane("pendulum", networks.pendulum(), 10.0),
    "chain-3": lambda: chain(3, 5.0),
    "chain-30": lambda: chain(30, 1.0),
    "four-bar": lambda: _plane("four-bar linkage", networks.four_bar(), 5.0),
    "disk": lambda: _disk(10.0),
    "spheres": _spheres,
    "landing": _landing,
}
