"""What a run gives: a table with named columns, and the account of how it was made."""

from __future__ import annotations

import dataclasses
from typing import Any

import numpy as np
import numpy.typing as npt

from lagcli.digits.accuracy import Accuracy

Floats = npt.NDArray[np.float64]


@dataclasses.dataclass(frozen=True, slots=True)
class Stats:
    """The account of a run, the object of `--stats`.

    steps: accepted ones; evaluations: of the right-hand side; seconds of wall time; position_drift and
    velocity_drift: largest |f_i| / |B_i| and |B_i v + b_i| / |B_i| over all rows written, the first also over
    |g_j| / |dg_j| of the first integrals that are held, g_j being the integral less its value at the start;
    energy_imbalance: largest deviation from the energy balance over all rows, as a part of the energies
    exchanged; indeterminate: rows whose multipliers are not unique; singular_times: times of singular
    configurations that were passed; accuracy: the estimate of the errors, where it was asked for.
    """

    steps: int
    rejected: int
    evaluations: int
    compile_seconds: float
    solve_seconds: float
    method: str
    position_drift: float
    velocity_drift: float
    energy_imbalance: float
    indeterminate: tuple[str, ...] = ()
    singular_times: tuple[float, ...] = ()
    accuracy: Accuracy | None = None

    def as_json(self) -> dict[str, Any]:
        """The object written by `--stats`."""
        account = dataclasses.asdict(self)
        del account["accuracy"]
        return account if self.accuracy is None else {**account, **self.accuracy.as_json()}


@dataclasses.dataclass(frozen=True, slots=True, eq=False)
class Trajectory:
    """The table of a run: `rows` (T, len(columns)), the first column `t`; notes: sentences about first integrals
    that were not held all the time."""

    columns: tuple[str, ...]
    rows: Floats
    stats: Stats
    notes: tuple[str, ...] = ()

    def __getitem__(self, column: str) -> Floats:
        """A column (T,) by its name, such as `lambda.rod`. Raises `KeyError`."""
        try:
            return self.rows[:, self.columns.index(column)]
        except ValueError:
            raise KeyError(column) from None

    @property
    def t(self) -> Floats:
        """The times (T,)."""
        return self["t"]

    @property
    def digits(self) -> dict[str, float | None]:
        """The number of right digits of `r`, `v`, `lambda` and `R` at the last row, of the largest value of each so
        far; None where there is nothing but zeros. Raises `ValueError` where the run was not asked for them."""
        if self.stats.accuracy is None:
            raise ValueError("the digits are not known: simulate with digits=True")
        return self.stats.accuracy.digits

    def multiplier(self, constraint: str) -> Floats:
        """lambda of a constraint, (T,); of a vector equation or a rigid body (T, rows)."""
        return self._group(f"lambda.{constraint}")

    def reaction(self, name: str) -> Floats:
        """R of a particle, (T, 3); of a generalized coordinate (T,)."""
        return self._group(f"R.{name}")

    def _group(self, name: str) -> Floats:
        if name in self.columns:
            return self[name]
        places = [i for i, column in enumerate(self.columns) if column.rpartition(".")[0] == name]
        if not places:
            raise KeyError(name)
        return self.rows[:, places]


class SimulationStopped(Exception):
    """The integration ended before its end; `trajectory` holds the complete rows so far, `t` the time reached."""

    def __init__(self, reason: str, t: float, trajectory: Trajectory) -> None:
        super().__init__(reason)
        self.reason, self.t, self.trajectory = reason, t, trajectory
