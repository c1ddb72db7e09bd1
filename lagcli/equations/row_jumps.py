"""The constants by which rows jump where their angles pass the cut of `atan2` or `atan`."""

from __future__ import annotations

import numpy as np

from lagcli.equations import system
from lagcli.model import model as nouns

# Jumps that are whole multiples of another, to rounding, are no jumps of their own.
WHOLE = 1e-9


def jumps(model: nouns.Model) -> dict[int, tuple[float, ...]]:
    """For each row that goes on beyond the cuts of its angles, by its number, the constants by which it jumps there."""
    if not any("atan" in text for text in _texts(model)):
        return {}
    built = system.build(model)
    if built.cuts is None:
        return {}
    cut, q = built.cuts, system.start(model)[0]
    p = system.values(built)[: cut.first]
    by = np.array(cut.change(model.simulation.start, q, p, np.zeros(cut.change.size1_in(3))))[:, 0]
    found: dict[int, list[float]] = {}
    for k in cut.passing:
        sizes = found.setdefault(cut.rows[k], [])
        size = abs(float(by[k]))
        if size and not any(abs(size / other - round(size / other)) < WHOLE for other in sizes):
            sizes.append(size)
    return {row: tuple(sorted(sizes)) for row, sizes in found.items() if sizes}


def _texts(model: nouns.Model) -> list[str]:
    texts = [law.equation.text for law in model.holonomic]
    texts += [definition.expression.text for definition in model.definitions]
    return texts + [part.text for p in model.particles if p.is_dependent for part in p.position.parts]
