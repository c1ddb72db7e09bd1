"""Which components of the reactions of joints are unique, where rows are dependent.

A component is sum_i c_i lambda_i. Multipliers are known but for the kernel of B^T: it is unique where it vanishes on
every w with B^T w = 0.
"""

from __future__ import annotations

import numpy as np

from lagcli import doubles
from lagcli.compiled import NumericSystem
from lagcli.equations.system import System
from lagcli.linear import rank
from lagcli.linear.metric_rows import MetricRows
from lagcli.start.initial import State, metric_at


def not_unique(system: System, numeric: NumericSystem, state: State) -> tuple[str, ...]:
    """The columns of reactions that are not unique at a state, in their order."""
    model = system.model
    if not model.joints:
        return ()
    rows = MetricRows(numeric.rows(state.t, state.q, state.v, state.p)[0], metric_at(numeric, state))
    kernel = (
        rank.space(rows.dense[: len(system.rows.rows)]).dependences / rows.lengths[: len(system.rows.rows)]
    )
    names = [name for joint in model.joints for name in joint.columns]
    lam, size = np.zeros(len(system.multiplier_rows)), float(np.abs(state.q).max(initial=0.0)) or 1.0
    found = np.zeros(len(names), dtype=bool)
    lengths = np.where([name.startswith("torque.") for name in names], size, 1.0)
    for w in kernel:
        lam[: w.size] = w
        values = (
            np.abs(np.array(numeric.joint_reactions(state.t, state.q, state.v, state.p, lam)).ravel())
            / lengths
        )
        found |= values > doubles.ROOT * values.max(initial=0.0)
    return tuple(name for name, is_open in zip(names, found, strict=True) if is_open)


def sentences(names: tuple[str, ...]) -> tuple[str, ...]:
    """What is said of columns that are left out: those of each kind and direction, and the way out."""
    groups: dict[str, list[str]] = {}
    for name in names:
        kind, joint, axis = name.split(".")
        groups.setdefault(f"{kind}.*.{axis}", []).append(joint)
    told = [
        f"{group} of {', '.join(joints)} is not unique: the joints hold more than they need to, and one may pass its"
        " part to the others; left out (`--columns` gives the least split)"
        for group, joints in groups.items()
    ]
    return (*told, "make one joint of the loop spherical and one cylindrical, and all reactions are unique")
