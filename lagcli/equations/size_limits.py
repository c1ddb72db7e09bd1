"""Limits on the size of a model: what would take more than about 2 GB is refused before it is begun."""

from __future__ import annotations

import numpy as np

from lagcli.equations.system import System
from lagcli.errors import diagnostics
from lagcli.model import model as nouns

# Components of particles, generalized coordinates and rows of constraints, all together: building and counting a chain
# takes about 2.2 kB and 50 us of each.
MOST_BUILT = 450_000
# Bytes of a run: all that is there without a model, of each coordinate, of each row, of each entry of B M^-1 B^T, as
# measured on free particles, chains and rigid bodies.
ALWAYS, OF_COORDINATE, OF_ROW, OF_ENTRY = 6e7, 4.8e3, 2.5e4, 4e2
MOST_BYTES = 2e9


def require_built(model: nouns.Model) -> None:
    """Raise `diagnostics.ModelError` for a model whose equations would take too much memory and time to build."""
    total = sum(size for size, _ in _sizes(model))
    if total > MOST_BUILT:
        message = (
            f"the model is too large: components of particles, coordinates and rows of constraints are {total}"
            f" together, and equations are built for at most {MOST_BUILT}"
        )
        raise _too_large(message, model)


def require_run(system: System) -> None:
    """Raise `diagnostics.ModelError` for a system whose step would take too much memory."""
    count, n = system.rows.B.shape
    # Rows that share a coordinate have an entry in B M^-1 B^T.
    of_columns = np.bincount(np.array(system.rows.B.sparsity().get_col(), dtype=np.intp), minlength=n)
    entries = min(float(count) ** 2, float(np.sum(of_columns.astype(float) ** 2)))
    needed = ALWAYS + OF_COORDINATE * n + OF_ROW * count + OF_ENTRY * entries
    if needed > MOST_BYTES:
        message = (
            f"the model is too large to be run: {n} coordinates and {count} rows would take about"
            f" {needed / 1e9:.1f} GB, and at most {MOST_BYTES / 1e9:.0f} GB are taken"
        )
        raise _too_large(message, system.model)


def rows(law: nouns.Holonomic | nouns.Differential | nouns.RigidBody | nouns.Inequality) -> int:
    """The number of rows a constraint stands for, at most."""
    if isinstance(law, nouns.RigidBody):
        return 3 * len(law.particles)
    if isinstance(law, nouns.Inequality):
        return law.members.count
    return law.members.count * (3 if law.is_vector else 1)


def _sizes(model: nouns.Model) -> list[tuple[int, diagnostics.Location]]:
    sizes = [(3 * p.members.count, p.location) for p in model.particles]
    sizes += [(c.members.count, c.location) for c in model.coordinates]
    for law in model.constraints():
        at = law.location if isinstance(law, nouns.RigidBody) else law.equation.location
        sizes.append((rows(law), at))
    return sizes


def _too_large(message: str, model: nouns.Model) -> diagnostics.ModelError:
    _, location = max(_sizes(model), key=lambda each: each[0])
    return diagnostics.error("too-large-to-build", message, location, "model fewer members")
