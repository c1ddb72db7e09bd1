"""The contents of a figure of a run: multipliers lambda_i(t) and constraint forces R_k(t), as panels of curves.

R_k = sum_i lambda_i B_ik (D.13-D.22), so a multiplier has the unit of force times length over the unit of its
f_i. That unit is not declared anywhere, and equations of one model may differ in it: multipliers share one
panel only while their values are of like size.
"""

import dataclasses
from collections.abc import Collection, Iterable, Sequence

import numpy as np
from numpy.typing import NDArray

from lagcli.model import dimension_facts
from lagcli.output.figures import decimate
from lagcli.output.figures.labels import UnitLabels, force_unit, multiplier_unit, with_unit

_OVERLAID = 6  # curves in one panel whose colors are told apart
# Curves with ranges that differ by more have panels of their own.
# `tests/unit/test_drawing_thresholds.py::test_curves_of_like_size_share_axes` fails at 300 and 3.
_LIKE_SIZE = 30.0
_MULTIPLIER_PANELS = 50  # of more rows all curves stand in one panel
_FORCE_PANELS = 12  # of more particles one panel shows the sizes of all; names in a note
_NUMBERS = 100_000  # of a figure, shared by its curves, which are decimated to 200 points at the least
_MARK = " (not unique)"
_NOT_UNIQUE = (
    "not unique: the constraints are dependent, and of all λ with the same R those with the least Σ λᵢ² Bᵢ M⁻¹ Bᵢᵀ are"
    " shown"
)
# Below this part of the largest value a curve is round-off.
# `tests/unit/test_drawing_thresholds.py::test_forces_that_are_rounding_have_no_panel` fails at 1e-11 and 1e-13.
ROUND_OFF = 1e-12
# The largest size on an axis: ticks around it, and their differences, are doubles too.
LARGEST = 1e300
# Of a value that is all there is on an axis: half of what the axis shows, where that is more than 0.5.
# `tests/unit/test_drawing_thresholds.py::test_an_instant_far_from_zero_has_an_axis_around_it` fails at 1e-11 and 1e-13.
POINT = 1e-12


@dataclasses.dataclass(frozen=True, slots=True)
class PanelFacts:
    """The known facts of the columns of a run.

    indeterminate: constraints of which lambda is not unique, by name; zeros: columns that are zero to rounding and are
    shown as zero; dimensions: of rows and coordinates, where they are known; is_choice: the columns are some of those
    of a run; incidents: their times and kinds.
    """

    indeterminate: Collection[str] = ()
    zeros: Collection[str] = ()
    dimensions: dimension_facts.DimensionFacts = dimension_facts.NOTHING
    is_choice: bool = False
    incidents: Sequence[tuple[float, str]] = ()


NOTHING = PanelFacts()


@dataclasses.dataclass(frozen=True, slots=True, eq=False)
class Curve:
    """One quantity against time; ``t`` and ``values`` have one shape (k,)."""

    label: str
    t: NDArray[np.float64]
    values: NDArray[np.float64]


@dataclasses.dataclass(frozen=True, slots=True)
class Panel:
    """Curves on common axes."""

    title: str
    curves: tuple[Curve, ...]


@dataclasses.dataclass(frozen=True, slots=True)
class Band:
    """Panels of one kind of quantity; a ``family`` is one panel of many curves, told apart by their index."""

    heading: str
    label: str
    panels: tuple[Panel, ...]
    family: bool = False
    note: str = ""


@dataclasses.dataclass(frozen=True, slots=True, eq=False)
class _Table:
    indices: dict[str, int]
    rows: NDArray[np.float64]

    def column(self, name: str) -> NDArray[np.float64]:
        return self.rows[:, self.indices[name]]

    def curve(self, label: str, values: NDArray[np.float64], of: int) -> Curve:
        """The curve, decimated for a figure that shows ``of`` of them."""
        chosen = decimate.extrema(values, min(4000, max(200, _NUMBERS // of)))
        return Curve(label, self.column("t")[chosen], values[chosen])


def bands(
    columns: Sequence[str],
    rows: NDArray[np.float64],
    units: UnitLabels,
    facts: PanelFacts = NOTHING,
) -> list[Band]:
    """The bands of the figure of a run, from top to bottom.

    ``rows`` has shape (T, len(columns)). Every ``lambda.NAME`` is shown, zero or not; of the particles
    (columns ``R.NAME.x``, ``.y``, ``.z``) and coordinates (``R.NAME``) those whose force is not zero
    throughout. Raises ValueError where the column ``t`` is missing.
    """
    if "t" not in columns:
        raise ValueError('a figure needs the column "t"')
    zeros = facts.zeros
    others = rows[:, [name != "t" for name in columns]]
    is_large = bool((np.abs(others[np.isfinite(others)]) > LARGEST).any())
    if is_large:
        rows = np.where(np.array(columns) == "t", rows, fit(rows))
    if zeros:
        rows = np.where(np.isin(columns, list(zeros)), 0.0, rows)
    table = _Table({name: index for index, name in enumerate(columns)}, rows)
    forces = [name.removeprefix("R.") for name in columns if name.startswith("R.")]
    particles = [name.removesuffix(".x") for name in forces if name.endswith(".x")]
    # Names hold no dot, so "R.theta" is a coordinate and "R.a.x" belongs to a particle.
    coordinates = [name for name in forces if "." not in name]
    multipliers = [name for name in columns if name.startswith("lambda.")]
    hidden = facts.is_choice and not multipliers
    found = [] if hidden else [_multipliers(table, multipliers, units, facts)]
    if particles:
        found.append(_particle_forces(table, particles, units))
    if coordinates:
        found.append(_coordinate_forces(table, coordinates, units, facts))
    idle = [name.removeprefix("lambda.") for name in multipliers if not _size(table.column(name))]
    if idle:
        rounded = any(f"lambda.{name}" in zeros for name in idle)
        zero_note = f"{'zero to rounding' if rounded else 'zero throughout'}: {_listed(idle)}"
        found[0] = dataclasses.replace(found[0], note="; ".join(filter(None, (found[0].note, zero_note))))
    if is_large:
        found = [dataclasses.replace(band, label=fitted(band.label)) for band in found]
    if zeros:
        for index, band in enumerate(found):
            note = band.note.replace("zero throughout", "zero to rounding")
            found[index] = dataclasses.replace(band, note=note)
    return found


def _multipliers(table: _Table, names: list[str], units: UnitLabels, facts: PanelFacts) -> Band:
    heading = "Multipliers λᵢ of the constraints"
    indeterminate = facts.indeterminate
    units_of = [multiplier_unit(name, units, facts.dimensions) for name in names]
    is_one = len(set(units_of)) <= 1
    label = with_unit("λᵢ", units_of[0] if units_of and is_one else "")
    if not names:
        return Band(heading, label, (), note="no constraints")
    # A name in brackets is no name of a constraint: the mark cannot be taken for one.
    marks = {f"lambda.{name}": _MARK for name in indeterminate}
    curves = [
        table.curve(name.removeprefix("lambda.") + marks.get(name, ""), table.column(name), of=len(names))
        for name in names
    ]
    note = _NOT_UNIQUE if indeterminate else ""
    if len(curves) > _MULTIPLIER_PANELS:
        mixed = with_unit("λᵢ", "" if is_one else "units differ")
        return Band(heading, label if is_one else mixed, (Panel("", tuple(curves)),), family=True, note=note)
    if 1 < len(curves) <= _OVERLAID and is_one and _of_like_size(curves):
        return Band(heading, label, (Panel("", tuple(curves)),), note=note)
    panels = tuple(
        Panel(curve.label if is_one else with_unit(curve.label, unit), (curve,))
        for curve, unit in zip(curves, units_of, strict=True)
    )
    return Band(heading, label, panels, note=note)


def _particle_forces(table: _Table, particles: list[str], units: UnitLabels) -> Band:
    heading = "Constraint forces Rₖ on the particles"
    forces = {
        name: np.stack([table.column(f"R.{name}.{axis}") for axis in "xyz"], axis=1) for name in particles
    }
    shown, note = _acting({name: sizes(force) for name, force in forces.items()})
    unit = force_unit(units)
    if len(shown) > _FORCE_PANELS:
        curves = [table.curve(name, sizes(forces[name]), of=len(shown)) for name in shown]
        return Band(heading, with_unit("|Rₖ|", unit), (Panel("", tuple(curves)),), family=True, note=note)
    panels = [
        Panel(
            name,
            tuple(
                table.curve(f"{axis} component", forces[name][:, index], of=3 * len(shown))
                for index, axis in enumerate("xyz")
            ),
        )
        for name in shown
    ]
    return Band(heading, with_unit("Rₖ", unit), tuple(panels), note=note)


def _coordinate_forces(table: _Table, coordinates: list[str], units: UnitLabels, facts: PanelFacts) -> Band:
    heading = "Generalized constraint forces Qʹⱼ on the coordinates"
    unit = force_unit(units, length_power=2)
    are_angles = {dimension_facts.base(name) for name in coordinates} <= facts.dimensions.angles
    label = with_unit("Qʹⱼ", unit if are_angles else f"{unit or '1'} / unit of qⱼ")
    forces = {name: table.column(f"R.{name}") for name in coordinates}
    shown, note = _acting(forces)
    curves = [table.curve(name, forces[name], of=len(shown)) for name in shown]
    if len(curves) > _FORCE_PANELS:
        return Band(heading, label, (Panel("", tuple(curves)),), family=True, note=note)
    return Band(heading, label, tuple(Panel(curve.label, (curve,)) for curve in curves), note=note)


def _acting(forces: dict[str, NDArray[np.float64]]) -> tuple[list[str], str]:
    """The names whose force is not zero throughout (but for round-off), and a note on the others."""
    found = {name: _size(force) for name, force in forces.items()}
    floor = ROUND_OFF * max(found.values())
    shown = [name for name, size in found.items() if size > floor]
    idle = [name for name, size in found.items() if size <= floor]
    if not idle:
        return shown, ""
    if not shown:
        return shown, "zero throughout"
    return shown, f"zero throughout: {_listed(idle)}"


def _listed(idle: list[str]) -> str:
    return ", ".join(idle) if len(idle) <= _FORCE_PANELS else f"{len(idle)} others"


def _of_like_size(curves: Iterable[Curve]) -> bool:
    return are_of_like_size([size for size in (_size(curve.values) for curve in curves) if size > 0])


def sizes(vectors: NDArray[np.float64]) -> NDArray[np.float64]:
    """The lengths of vectors (..., 3), whose squares may be beyond all doubles."""
    return np.asarray(np.hypot(np.hypot(vectors[..., 0], vectors[..., 1]), vectors[..., 2]))


def fit(values: NDArray[np.float64]) -> NDArray[np.float64]:
    """Values that are too large for an axis, as they are drawn: none of them is larger than `LARGEST` then."""
    return np.asarray(values / 10**10)


def fitted(label: str) -> str:
    """The name of an axis of such values."""
    return f"{label} × 1e-10"


def widened(span: tuple[float, float], part: float = 0.0) -> tuple[float, float]:
    """The limits of an axis that shows all of a span, and a part of it more at both ends; the span may be a point."""
    low, high = (min(max(end, -LARGEST), LARGEST) for end in span)
    if low == high:
        half = max(0.5, POINT * abs(low))
        return low - half, high + half
    return low - part * (high - low), high + part * (high - low)


def are_of_like_size(sizes: Sequence[float]) -> bool:
    """True if curves of these sizes, none of them zero, can be read on common axes."""
    return not sizes or max(sizes) <= _LIKE_SIZE * min(sizes)


def _size(values: NDArray[np.float64]) -> float:
    return float(np.nanmax(np.abs(values), initial=0.0))
