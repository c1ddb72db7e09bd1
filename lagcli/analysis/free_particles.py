"""Particles that nothing holds: 3N degrees of freedom, whatever acts on them, so that no equation need be built."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from lagcli.analysis.dof import DofCount
from lagcli.equations import size_limits
from lagcli.model.model import Model, ParticleForce

if TYPE_CHECKING:
    from lagcli.analysis.check_report import Report


def holds_for(model: Model) -> bool:
    """True if a model has particles alone, free ones, and at most constant forces on them."""
    return (
        not any(size_limits.rows(law) for law in model.constraints())
        and not (model.coordinates or model.outputs or model.lagrangian)
        and all(isinstance(force, ParticleForce) and force.constant for force in model.forces)
        and all(
            p.start is not None and np.isfinite(p.mass_values).all() and np.isfinite(p.start).all()
            for p in model.particles
        )
    )


def count(model: Model) -> DofCount:
    """The count of such a model."""
    particles = sum(p.members.count for p in model.particles)
    n = 3 * particles
    return DofCount(
        particles=particles,
        coordinates=n,
        holonomic=0,
        nonholonomic=0,
        redundant=0,
        configuration_dof=n,
        velocity_dof=n,
        proof="numeric",
        bounds=(n, n),
        reason="",
        redundant_rows=(),
        start_rank=0,
        notes=(),
        rows=0,
        rank=0,
    )


def check(model: Model) -> Report:
    """The report of such a model: there is nothing to be wrong."""
    from lagcli.analysis.check_report import Initial, Report, joint  # here, as a count needs no report
    from lagcli.analysis.classification.verdict import Classification

    counted = count(model)
    return Report(
        title=model.title,
        path=model.path,
        dof=counted,
        constraints=(),
        null_vectors=(),
        joint=joint(counted, Classification((), (), False)),
        initial=Initial(0.0, 0.0, True),
        warnings=model.warnings,
    )
