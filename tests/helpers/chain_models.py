"""Random chains of rods in a box whose walls move, as `one_sided_models.Scene`: impacts that rods hand on, contacts
under tension, many series of rebounds at a time."""

from __future__ import annotations

import dataclasses

import numpy as np

from tests.helpers import one_sided_models
from tests.helpers.one_sided_models import Contact, Floats, Scene

MOST = 6  # particles of a chain


def chain(seed: int) -> Scene:
    """A random chain of two to six particles, between a floor and two or three walls; the same for the same seed."""
    random = np.random.default_rng([41, seed])
    count = int(random.integers(2, MOST + 1))
    flat = bool(random.random() < 0.7)
    x = _folded(random, count, flat)
    rods = tuple((i, i + 1) for i in range(count - 1))
    if count > 3 and random.random() < 0.3:
        rods = rods[: count // 2] + rods[count // 2 + 1 :]  # two chains, which pass through each other
    v = random.normal(0, 1.0, 3) * (1, 0 if flat else 1, 1) + np.zeros((count, 3))
    if random.random() < 0.5:
        v = v + np.cross(random.normal(0, 2, 3) * ((0, 1, 0) if flat else (1, 1, 1)), x)
    common = float(random.choice([0.0, 0.5, random.uniform(0, 1), random.uniform(0.7, 1)]))
    mixed = bool(random.random() < 0.3)
    contacts = []
    for k, (normal, size) in enumerate(_walls(random, flat)):
        drive = _drive(random)
        e = float(random.uniform(0, 0.9)) if mixed else common
        contacts += [Contact(f"w{k}_{i}", (i,), size, e, normal, **drive) for i in range(count)]
    weight = np.array([0.0, 0.0, -float(random.uniform(2, 10))])
    m = np.exp(random.normal(0, 0.4, count))
    scene = Scene("chain", m, x, v, weight, tuple(contacts), rods, float(random.uniform(0.8, 2)))
    lowest = min(c.gap(0.0, x) for c in scene.contacts)
    moved = [dataclasses.replace(c, size=c.size + min(0.0, lowest - 0.05)) for c in scene.contacts]
    return dataclasses.replace(scene, contacts=tuple(moved))


def _folded(random: np.random.Generator, count: int, flat: bool) -> Floats:
    """Places of a chain in the middle of the box, each rod turned at random."""
    steps = random.normal(0, 1, (count - 1, 3)) * (1, 0 if flat else 1, 1)
    steps *= (random.uniform(0.2, 0.5, count - 1) / np.linalg.norm(steps, axis=1))[:, None]
    x = np.concatenate([np.zeros((1, 3)), np.cumsum(steps, axis=0)])
    return np.asarray(x - x.mean(axis=0))


def _walls(random: np.random.Generator, flat: bool) -> list[tuple[tuple[float, float, float], float]]:
    """Inward normals and their sizes (n.x >= size): a floor, and walls."""
    found = [((0.0, 0.0, 1.0), -float(random.uniform(0.4, 0.9)))]
    if random.random() < 0.7:
        normals = one_sided_models.polygon(random, 3, 1.0) if flat else [(1.0, 0.0, 0.0), (0.0, -1.0, 0.0)]
        found += [(normal, -float(random.uniform(0.6, 1.0))) for normal in normals[:2]]
    return found


def _drive(random: np.random.Generator) -> dict[str, tuple[float, float]]:
    """A motion of a wall."""
    match int(random.integers(0, 4)):
        case 0:
            return {"move": (float(random.uniform(-0.3, 0.2)), 0.0)}
        case 1:
            return {"move": (float(random.uniform(-0.2, 0.2)), float(random.uniform(-0.2, 0.2)))}
        case 2:
            return {"swing": (float(random.uniform(0.01, 0.1)), float(random.uniform(3, 20)))}
    return {}
