"""The start of a run: finite, with inertia, on the constraints; or refused."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Sequence

import numpy as np
import numpy.typing as npt

from lagcli import doubles
from lagcli.arrays import Floats
from lagcli.compiled import NumericSystem, row_block
from lagcli.equations import system as mechanics
from lagcli.equations.system import System
from lagcli.errors import diagnostics
from lagcli.frozen import frozen
from lagcli.linear import decompositions
from lagcli.linear.metric import Metric, NotDefiniteError
from lagcli.linear.metric_rows import LocalRows, Sparse, stacked
from lagcli.model import model as nouns


class StartParameters:
    """Limits of a start. The tests are of `tests/unit/test_numbers_of_starts.py` and
    `tests/unit/test_start_thresholds.py`."""

    __slots__ = ()

    least: float = 1e-3
    """A coordinate near zero is no smaller than this part of the largest one, from which it was computed:
    `test_a_coordinate_near_zero_has_the_rounding_of_larger_ones`."""
    most_listed: int = 20
    """Rows that a message names one by one (`test_twenty_rows_are_named_one_by_one`)."""
    later: float = 1e-2
    """How far points move on in time, as a part of the duration: before other laws come to their ends
    (`test_points_move_on_by_a_hundredth_of_the_duration`)."""
    fallen: float = least
    """An inertia has fallen below this part of that at the start (`test_an_inertia_has_fallen_below_a_thousandth`)."""


PARAMETERS = StartParameters()
MOST_NAMED = 4  # coordinates of a motion, so that a sentence stays one
SINGULAR_HINT = (
    "start away from a singular configuration (the centre of polar, the pole of spherical coordinates)"
)


def later(system: System) -> float:
    """How far points of a system move on in time, 0 where nothing depends on it."""
    if not row_block.depends_on_time(system):
        return 0.0
    return PARAMETERS.later * (system.model.simulation.duration or 1.0)


@dataclasses.dataclass(frozen=True, slots=True, eq=False)
class State:
    """t, q (n,), v (n,) and the parameters p that go with them."""

    t: float
    q: Floats
    v: Floats
    p: Floats


@frozen
class Residuals:
    """|f_i| / |B_i| of the holonomic rows (s,) and |B_i v + b_i| / |B_i| of all rows (C,), with what is allowed; norms
    (C,): |B_i|, 1 for the `flat` ones (C,), whose gradient vanishes or has no value."""

    position: Floats
    velocity: Floats
    position_limit: Floats
    velocity_limit: Floats
    flat: npt.NDArray[np.bool_]
    norms: Floats

    @property
    def of_positions(self) -> float:
        """The largest |f_i|, as the equation is written."""
        return float((self.position * self.norms[: self.position.size]).max(initial=0.0))

    @property
    def of_velocities(self) -> float:
        """The largest |B_i v + b_i|, as the equation is written."""
        return float((self.velocity * self.norms).max(initial=0.0))

    @property
    def consistent(self) -> bool:
        return not self.violated

    @property
    def violated(self) -> list[int]:
        """The rows that are not."""
        broken = ~(self.velocity <= self.velocity_limit)
        broken[: self.position.size] |= ~(self.position <= self.position_limit)
        return [int(i) for i in np.flatnonzero(broken)]

    def in_position(self, i: int) -> bool:
        """True if a row that is violated is so at position level."""
        return i < self.position.size and not self.position[i] <= self.position_limit[i]

    def size(self, i: int) -> float:
        """The violation of a row, at position level or else at velocity level."""
        return float(self.position[i] if self.in_position(i) else self.velocity[i])


def size(q: Floats) -> float:
    """The size of a configuration q (n,): its largest coordinate, or 1 where all of it is at zero."""
    return float(np.abs(q).max(initial=0.0)) or 1.0


def declared(system: System) -> State:
    """The state a model declares."""
    q, v = mechanics.start(system.model)
    return State(system.model.simulation.start, q, v, mechanics.values(system))


def inertia(
    system: System, numeric: NumericSystem, state: State, fixed: npt.NDArray[np.bool_] | None = None
) -> Metric:
    """The mass metric at a state. Raises `diagnostics.ModelError`, by name, where M is not positive definite."""
    M, model = numeric.inertia(state.t, state.q, state.v, state.p), system.model
    names = model.coordinate_names
    rows, values = np.asarray(M.sparsity().row(), dtype=int), np.array(M.nonzeros(), dtype=float)
    for i in rows[~np.isfinite(values)][:1]:
        raise _not_finite(model.location(names[i]), f"the inertia of `{names[i]}`")
    faults = []
    # Where a row of M is zero there is no acceleration in its equation.
    sizes = np.bincount(rows, weights=np.abs(values), minlength=len(names))
    entered = np.bincount(rows, minlength=len(names)) > 0
    for i in np.flatnonzero(sizes == 0).tolist():
        if entered[i]:
            message = (
                f"the coordinate `{names[i]}` has no inertia at the start: what the energy holds of its rate has a"
                " second derivative that vanishes there"
            )
            hint = f"{SINGULAR_HINT} or with another rate, or choose other coordinates"
        else:
            message = (
                f"the coordinate `{names[i]}` has no inertia: no kinetic energy is quadratic in its rate, so its"
                " equation holds no acceleration"
            )
            hint = (
                "give it a mass, or write it as a function of other coordinates, from the constraint if one fixes it;"
                " equations of first order, from a Lagrangian linear in the rate, are not solved"
            )
        faults.append(diagnostics.Diagnostic("no-inertia", message, model.location(names[i]), hint))
    if not faults:
        try:
            return Metric(M, fixed)
        except NotDefiniteError:
            faults.append(indefinite(np.array(M), model))
    raise diagnostics.ModelError(faults)


def indefinite(M: Floats, model: nouns.Model) -> diagnostics.Diagnostic:
    """The motion for which v^T M v is smallest, for an M (n, n) without zero rows that is not positive definite."""
    scale = 1.0 / np.sqrt(np.abs(M).max(axis=1))  # so that the answer does not depend on units
    values, vectors = np.linalg.eigh(M * np.outer(scale, scale))
    motion = scale * vectors[:, 0]
    names = model.coordinate_names
    along, shown = names[int(np.argmax(np.abs(vectors[:, 0])))], _motion(motion, names)
    if values[0] > -doubles.ZERO * values[-1]:
        message = f"no kinetic energy resists the motion {shown} at the start: the inertia matrix is singular"
        hint = (
            "leave out a coordinate that describes the same motion as others (where a constraint fixes it, insert"
            f" what the constraint says), give it a mass, or {SINGULAR_HINT}"
        )
    else:
        message = (
            f"the kinetic energy of the motion {shown} is negative at the start: the inertia matrix is not positive"
            " definite"
        )
        hint = "correct the sign in the Lagrangian: kinetic energy must grow with every motion"
    return diagnostics.Diagnostic("indefinite-inertia", message, model.location(along), hint)


def fallen(M: Sparse, before: Sparse, names: Sequence[str]) -> str:
    """The loss of the inertia M (n, n) of a later state against `before` at the start, positive definite, as a
    sentence, or nothing: by the least v^T M v / v^T M_before v, which no units change."""
    if M.shape[0] > 300:
        return ""  # eigenvalues would take long
    old, new = np.array(before), np.array(M)
    if not np.isfinite(new).all() or (old == new).all():
        return ""
    scale = 1.0 / np.sqrt(np.diag(old))
    inverse = np.linalg.inv(np.linalg.cholesky(old * np.outer(scale, scale)))
    values, vectors = np.linalg.eigh(inverse @ (new * np.outer(scale, scale)) @ inverse.T)
    if values[0] >= PARAMETERS.fallen:
        return ""
    motion = _motion(scale * (inverse.T @ vectors[:, 0]), names)
    part = f"{values[0]:.2g} times that at the start"
    return f"the inertia of the motion {motion} is {part}: the equations become singular"


def _motion(motion: Floats, names: Sequence[str]) -> str:
    """A motion as its rates, the largest 1 in size: `rate(x) = 1, a.vx = -1`."""
    largest = np.abs(motion).max()
    part = motion / motion[int(np.argmax(np.abs(motion) > 0.999 * largest))]
    moved = np.flatnonzero(np.abs(part) > doubles.ROOT).tolist()
    named = []
    for i in moved[:MOST_NAMED]:
        owner, dot, axis = names[i].rpartition(".")
        rate = f"{owner}.v{axis}" if dot else f"rate({names[i]})"
        named.append(f"{rate} = {part[i]:.4g}")
    more = len(moved) - len(named)
    return f"({', '.join(named)}{f' and {more} more' if more else ''})"


def _not_finite(location: diagnostics.Location, what: str) -> diagnostics.ModelError:
    message = f"{what} is not finite at the start"
    hint = "a function of the model has a pole or is not defined there"
    return diagnostics.error("not-finite-at-start", message, location, hint)


def require_finite(system: System, numeric: NumericSystem, state: State) -> None:
    """Raise `diagnostics.ModelError` where a force or a column is not finite at a state, by name. The rows must be
    independent there."""
    h, *_ = numeric.force(state.t, state.q, state.v, state.p)
    bad = np.flatnonzero(~np.isfinite(np.array(h).ravel()))
    if bad.size:
        name = system.model.coordinate_names[int(bad[0])]
        raise _not_finite(system.model.location(name), f"the force along `{name}`")
    row = np.array(numeric.record(state.t, np.concatenate([state.q, state.v, [0.0]]), state.p)[1]).ravel()
    bad = np.flatnonzero(~np.isfinite(row))
    if bad.size:
        # Where its quantity was declared, or what the energy is made of.
        model, column = system.model, system.columns[int(bad[0])]
        made_of = [output.expression for output in model.outputs if column in output.columns]
        if column == "energy":
            made_of += (force.expression for force in model.forces if isinstance(force, nouns.Potential))
            made_of += [] if model.lagrangian is None else [model.lagrangian]
        location = made_of[0].location if made_of else diagnostics.Location(model.path, 1, 1)
        raise _not_finite(location, f"the column `{column}`")


def residuals(system: System, numeric: NumericSystem, state: State) -> Residuals:
    """The residuals of a state in the constraints. Raises `diagnostics.ModelError` where a row is not finite."""
    f, rows, b = finite_rows(system, numeric, state, forgiving=True)
    s, norms = f.size, rows.divisors
    # A system at rest carries the rounding of the speeds its velocities were computed from, of which some may be its
    # size in the time of the run. As a plain number: in the shortest of times it is inf.
    slow = doubles.ROOT * float(np.abs(state.q).max(initial=0.0)) / (system.model.simulation.duration or 1.0)
    speed = np.maximum(np.maximum(_sizes(rows, state.v), np.abs(b) / norms), slow)
    position = np.abs(f) / norms[:s]

    def rows_at(q: Floats) -> LocalRows:
        return LocalRows(numeric.rows(state.t, q, state.v, state.p)[0])

    violations = np.zeros(norms.size)
    violations[:s] = position
    allowed = limits(rows_at, state, rows, violations)[:s]
    velocity, allowed_velocity = np.abs(rows.times(state.v) + b) / norms, doubles.ZERO * speed
    if not (velocity <= allowed_velocity).all():
        # What a row demands of velocities may be the rounding of terms that cancel, 100 (cos(x) - y/2) at x = pi/3; the
        # nearest velocity leaves a part of it to every row beside it.
        terms = np.array(numeric.row_terms(state.t, state.q, state.v, state.p)[1]).ravel()[: norms.size]
        allowed_velocity += doubles.SUM * float((terms / norms).max(initial=0.0))
    return Residuals(position, velocity, allowed, allowed_velocity, rows.norms == 0, norms)


def limits(
    rows_at: Callable[[Floats], LocalRows], state: State, rows: LocalRows, residuals: Floats
) -> Floats:
    """Residuals that are none, for a gradient of length one: rounding, or where some are more that of decimals.
    rows_at: the rows at other configurations q (n,); rows: at the state."""
    sizes = _sizes(rows, state.q)
    found = doubles.SUM * sizes
    if (residuals > found).any():
        # The rounding of declared decimals, a part of the size of each row: of its coordinates, but no more than its
        # radius of curvature |B_i| / |dB_i/dq|, as a rod of ten metres far from the origin is ten metres large.
        largest = float(np.abs(state.q).max(initial=0.0))
        direction = decompositions.generic_direction(state.q.size, 0)
        radius = np.full(rows.count, np.inf)
        for k in range(12):
            step = largest * 10.0**-k
            there = rows_at(state.q + step * direction)
            with np.errstate(all="ignore"):  # a row may have no value there, or not change
                estimate = step * rows.norms / LocalRows(rows.B - there.B).norms
            radius = np.fmin(radius, np.where(estimate > 0, estimate, np.inf))
        found += doubles.ZERO * np.minimum(sizes, radius)
    return np.asarray(found)


def finite_rows(
    system: System, numeric: NumericSystem, state: State, forgiving: bool = False
) -> tuple[Floats, LocalRows, Floats]:
    """f (s,), B and b (C,) at a state. Raises `diagnostics.ModelError` naming a row that is not finite. forgiving:
    where a row is violated a gradient without a value, as of the length of a rod whose ends coincide, is taken as 0."""
    f = np.array(numeric.holonomic(state.t, state.q, state.p)[0]).ravel()
    B, bias = numeric.rows(state.t, state.q, state.v, state.p)
    rows, b = LocalRows(B), np.array(bias).ravel()
    s = f.size
    good = rows.are_finite() & np.isfinite(rows.finite().norms) & np.isfinite(b)
    good[:s] &= np.isfinite(f)
    if forgiving:
        violated = np.isfinite(f) & (f != 0)
        b[:s][violated & ~np.isfinite(b[:s])] = 0.0
        good[:s] |= violated
        rows = rows.finite()
    if not good.all():
        row = system.rows.rows[int(np.argmin(good))]
        message = f"the constraint `{row.name}` or its gradient is not finite at the start"
        hint = "move the start off the pole, or write the constraint without it (for example squared)"
        raise diagnostics.error("not-finite-at-start", message, row.location, hint)
    return f, rows, b


def require_squares(system: System, numeric: NumericSystem, state: State, metric: Metric) -> None:
    """Raise `diagnostics.ModelError` where squares of the entries of a row, its own or those in the metric, are beyond
    the range of numbers: S = B M^-1 B^T would be 0 or infinite, and the row without effect."""
    B = numeric.rows(state.t, state.q, state.v, state.p)[0][: len(system.rows.rows), :]
    if system.contacts.count:
        B = stacked(B, numeric.contacts(state.t, state.q, state.v, state.p)[1])
    rows = LocalRows(B).finite()
    for lengths in (rows.norms, LocalRows(metric.whitened(rows.B)).norms):
        with np.errstate(over="ignore", under="ignore"):
            squares = lengths**2
        # What is added to squares that are divided by must not count.
        is_beyond = (squares < doubles.TINY / doubles.EPS) | ~np.isfinite(squares)
        for i in np.flatnonzero(is_beyond & (lengths != 0))[:1]:
            row = system.multiplier_rows[int(i)]
            size = f"{lengths[i]:.3g}" + ("" if lengths is rows.norms else " in units of the inertia")
            message = f"the gradient of `{row.name}` is {size}: its square is beyond the range of numbers"
            hint = "divide the equation by its size, or choose units in which it and the inertia are near 1"
            raise diagnostics.error("not-finite-at-start", message, row.location, hint)


def _sizes(rows: LocalRows, values: Floats) -> Floats:
    """The largest |value| a row touches, but no less than a small part of the largest of all: a coordinate near
    zero carries the rounding of what it was computed from."""
    sizes = np.abs(values)
    return np.asarray(np.maximum(rows.largest(sizes), PARAMETERS.least * sizes.max(initial=0.0)))


def inconsistencies(system: System, found: Residuals) -> list[diagnostics.Diagnostic]:
    """One diagnostic for each row that the start violates; of a family the first few, and one for the rest of it."""
    units = system.model.units

    def violation(i: int) -> diagnostics.Diagnostic:
        row, is_position = system.rows.rows[i], found.in_position(i)
        kind, unit = (
            ("positions", units.length) if is_position else ("velocities", f"{units.length}/{units.time}")
        )
        unit = f" {unit}" if not system.model.coordinates else ""
        by = violated(found.size(i), float(found.norms[i]), unit, is_position and bool(found.flat[i]))
        message = f"the initial {kind} violate `{row.name}` by {by}"
        hint = "correct the initial values, or use `--assemble` to move them to the nearest consistent state"
        return diagnostics.Diagnostic("inconsistent-start", message, row.location, hint)

    return by_family(found.violated, found.size, violation)


def by_family(
    broken: list[int], size: Callable[[int], float], shown: Callable[[int], diagnostics.Diagnostic]
) -> list[diagnostics.Diagnostic]:
    """The diagnostics of rows, as they are `shown`; of a family the first few, and that of the largest of the
    others."""
    report: list[diagnostics.Diagnostic] = []
    by_location: dict[diagnostics.Location, list[int]] = {}
    for i in broken:
        by_location.setdefault(shown(i).location, []).append(i)
    for family in by_location.values():
        report += map(shown, family[: PARAMETERS.most_listed])
        rest = family[PARAMETERS.most_listed :]
        if rest:
            worst = shown(max(rest, key=size))
            message = f"so do {len(rest)} more rows of this family; of them the most: {worst.message}"
            report.append(dataclasses.replace(worst, message=message))
    return report


def violated(scaled: float, norm: float, unit: str, is_flat: bool) -> str:
    """A residual of an equation as it is written, with that for a gradient of length one, which has a `unit`; is_flat:
    the gradient vanishes there, or has no value."""
    residual, shown = f"{scaled * norm:.6g}", f"{scaled:.6g}"
    if is_flat:
        return f"{shown} of its own unit (its gradient vanishes or has no value there)"
    if residual == shown:
        return f"{shown}{unit}"
    return f"{residual} ({shown}{unit} per unit of its gradient)"


def metric_at(numeric: NumericSystem, state: State, fixed: npt.NDArray[np.bool_] | None = None) -> Metric:
    """The mass metric at a state, or the unit metric where some coordinates have no inertia."""
    M = numeric.inertia(state.t, state.q, state.v, state.p)
    try:
        return Metric(M, fixed)
    except NotDefiniteError:
        return Metric.unit(M.shape[0], fixed)


def contradiction(system: System, rows: list[int], at: str = "") -> diagnostics.ModelError:
    """The error for rows of which a combination says dt = 0: no velocity satisfies them together, or only none `at`
    some configurations, in words."""
    names = names_of(system, rows)
    message = f"{names} contradict each other: a combination of them says dt = 0"
    if len(rows) == 1:
        message = f"{names} can never hold: it says dt = 0"
    if at:
        verb = "satisfies it" if len(rows) == 1 else "satisfies them together"
        message = f"{names}: no velocity {verb} {at}"
    return diagnostics.error("contradictory-constraints", message, system.rows.rows[rows[-1]].location)


def names_of(system: System, rows: Sequence[int]) -> str:
    """The names of rows, the first of them where they are many."""
    return quoted([system.multiplier_rows[i].name for i in rows])


def quoted(names: Sequence[str], most: int = PARAMETERS.most_listed) -> str:
    """Names in a sentence, the first of them where they are many."""
    shown = ", ".join(f"`{name}`" for name in names[:most])
    return shown + (f" and {len(names) - most} more" if len(names) > most else "")
