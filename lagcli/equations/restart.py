"""A model with another start."""

from __future__ import annotations

import dataclasses

import numpy as np
import numpy.typing as npt

from lagcli.model import model as nouns

Floats = npt.NDArray[np.float64]


def at(declared: nouns.Model, q: Floats, v: Floats) -> nouns.Model:
    """The model with the initial values q and v (n,)."""
    particles, coordinates, first = [], [], 0
    for particle in declared.particles:
        if particle.start is None:
            particles.append(particle)
            continue
        places = slice(first, first + 3 * particle.members.count)
        start, velocity = q[places].reshape(-1, 3), v[places].reshape(-1, 3)
        particles.append(dataclasses.replace(particle, start=start, start_velocity=velocity))
        first = places.stop
    for coordinate in declared.coordinates:
        places = slice(first, first + coordinate.members.count)
        coordinates.append(dataclasses.replace(coordinate, value=q[places], rate=v[places]))
        first = places.stop
    return dataclasses.replace(
        declared, particles=tuple(particles), coordinates=tuple(coordinates), origin=None
    )
