"""The contents of a figure of a run: multipliers lambda_i(t) and constraint forces R_k(t), as panels of curves.

R_k = sum_i lambda_i B_ik (D.13-D.22), so a multiplier has the unit of force times length over that of its f_i, which
differs from row to row: multipliers share one panel only while their values are of like size.
"""

import dataclasses
from collections.abc import Collection, Sequence

import numpy as np

from lagcli import doubles
from lagcli.arrays import Floats
from lagcli.model import dimension_facts
from lagcli.model.model import Units
from lagcli.output.figures import chart
from lagcli.output.figures.chart import LARGEST, ChartCurve, ChartPanel, LegendKey
from lagcli.output.figures.labels import force_unit, multiplier_unit, with_unit

_OVERLAID = 6  # curves in one panel whose colors are told apart
_LIKE_SIZE = 30  # curves with ranges that differ by more have panels of their own
_MULTIPLIER_PANELS = 50  # of more rows all curves stand in one panel
_FORCE_PANELS = 12  # of more particles one panel shows the sizes of all; names in a note
_NUMBERS = 100_000  # of a figure, shared by its curves, which are decimated to 200 points at the least
_MARK = " (not unique)"
_NOT_UNIQUE = (
    "not unique: the constraints are dependent, and of all λ with the same R those with the least Σ λᵢ² Bᵢ M⁻¹ Bᵢᵀ are"
    " shown"
)


@dataclasses.dataclass(frozen=True, slots=True)
class PanelFacts:
    """The known facts of the columns of a run.

    indeterminate: constraints of which lambda is not unique; zeros: columns that are zero to rounding; dimensions: of
    rows and coordinates; is_choice: the columns are some of those of a run; incidents: their times and kinds.
    """

    indeterminate: Collection[str] = ()
    zeros: Collection[str] = ()
    dimensions: dimension_facts.DimensionFacts = dimension_facts.NOTHING
    is_choice: bool = False
    incidents: Sequence[tuple[float, str]] = ()


NOTHING = PanelFacts()


@dataclasses.dataclass(frozen=True, slots=True)
class Band:
    """Panels of one kind of quantity side by side under a heading, or one panel of many curves; a note below them."""

    heading: str
    panels: tuple[ChartPanel, ...]
    note: str = ""


@dataclasses.dataclass(frozen=True, slots=True, eq=False)
class _Table:
    """The rows of a run, with what all its panels share: the name and the ends of the axis of time."""

    indices: dict[str, int]
    rows: Floats
    units: Units
    facts: PanelFacts
    is_large: bool

    def column(self, name: str) -> Floats:
        return self.rows[:, self.indices[name]]

    def curve(self, label: str, values: Floats, of: int, look: int = 0) -> ChartCurve:
        """The curve, decimated for a figure that shows ``of`` of them."""
        chosen = chart.extrema(values, min(4000, max(200, _NUMBERS // of)))
        return ChartCurve(label, self.column("t")[chosen], values[chosen], look, look)

    def panel(
        self, label: str, curves: Sequence[ChartCurve], *, title: str = "", is_family: bool = False
    ) -> ChartPanel:
        t = self.column("t")
        has_keys = len(curves) > 1 and not is_family
        return ChartPanel(
            "time",
            with_unit("t", self.units.time.strip()),
            chart.fitted(label) if self.is_large else label,
            tuple(curves),
            tuple(LegendKey(c.label, c.colour, c.dash) for c in curves) if has_keys else (),
            is_family=is_family,
            limits=(float(t[0]), float(t[-1])) if len(t) else (0.0, 1.0),
            title=title,
        )

    def acting(self, forces: dict[str, Floats]) -> tuple[list[str], str]:
        """The names whose force is not zero throughout (but for round-off), and a note on the others."""
        sizes = {name: size(force) for name, force in forces.items()}
        floor = doubles.VALUE * max(sizes.values())
        shown = [name for name, size in sizes.items() if size > floor]
        return shown, self.idle([name for name, size in sizes.items() if size <= floor], bool(shown))

    def idle(self, names: list[str], is_listed: bool = True) -> str:
        """The note on columns without any value but zero, which may name them; none where there are no such."""
        throughout = "zero to rounding" if self.facts.zeros else "zero throughout"
        if not names or not is_listed:
            return throughout if names else ""
        listed = ", ".join(names) if len(names) <= _FORCE_PANELS else f"{len(names)} others"
        return f"{throughout}: {listed}"


def bands(columns: Sequence[str], rows: Floats, units: Units, facts: PanelFacts = NOTHING) -> list[Band]:
    """The bands of the figure of a run, from top to bottom; rows (T, len(columns)).

    Every ``lambda.NAME`` is shown, zero or not; of particles (``R.NAME.x``, ``.y``, ``.z``) and coordinates
    (``R.NAME``) those whose force is not zero throughout. Raises ValueError where the column ``t`` is missing.
    """
    if "t" not in columns:
        raise ValueError('a figure needs the column "t"')
    others = rows[:, [name != "t" for name in columns]]
    is_large = bool((np.abs(others[np.isfinite(others)]) > LARGEST).any())
    if is_large:
        rows = np.where(np.array(columns) == "t", rows, chart.fit(rows))
    if facts.zeros:
        rows = np.where(np.isin(columns, list(facts.zeros)), 0.0, rows)
    table = _Table({name: index for index, name in enumerate(columns)}, rows, units, facts, is_large)
    forces = [name.removeprefix("R.") for name in columns if name.startswith("R.")]
    particles = [name.removesuffix(".x") for name in forces if name.endswith(".x")]
    # Names hold no dot, so "R.theta" is a coordinate and "R.a.x" belongs to a particle.
    coordinates = [name for name in forces if "." not in name]
    multipliers = [name.removeprefix("lambda.") for name in columns if name.startswith("lambda.")]
    found = []
    if multipliers or not facts.is_choice:
        found.append(_multipliers(table, multipliers))
    if particles:
        found.append(_particle_forces(table, particles))
    if coordinates:
        found.append(_coordinate_forces(table, coordinates))
    return found


def _multipliers(table: _Table, names: list[str]) -> Band:
    heading = "Multipliers λᵢ of the constraints"
    if not names:
        return Band(heading, (), "no constraints")
    columns = [table.column(f"lambda.{name}") for name in names]
    units_of = [multiplier_unit(f"lambda.{name}", table.units, table.facts.dimensions) for name in names]
    is_one = len(set(units_of)) == 1
    label = with_unit("λᵢ", units_of[0] if is_one else "")
    open_ones = table.facts.indeterminate
    # A name in brackets is no name of a constraint: the mark cannot be taken for one.
    curves = [
        table.curve(name + _MARK * (name in open_ones), values, len(names), look)
        for look, (name, values) in enumerate(zip(names, columns, strict=True))
    ]
    idle = [name for name, values in zip(names, columns, strict=True) if not size(values)]
    note = "; ".join(filter(None, (_NOT_UNIQUE if open_ones else "", table.idle(idle))))
    if len(curves) > _MULTIPLIER_PANELS:
        mixed = label if is_one else with_unit("λᵢ", "units differ")
        return Band(heading, (table.panel(mixed, curves, is_family=True),), note)
    largest = [value for curve in curves if (value := size(curve.y)) > 0]
    if 1 < len(curves) <= _OVERLAID and is_one and are_of_like_size(largest):
        return Band(heading, (table.panel(label, curves),), note)
    panels = tuple(
        table.panel(
            label,
            [dataclasses.replace(curve, colour=0, dash=0)],
            title=curve.label if is_one else with_unit(curve.label, unit),
        )
        for curve, unit in zip(curves, units_of, strict=True)
    )
    return Band(heading, panels, note)


def _particle_forces(table: _Table, particles: list[str]) -> Band:
    heading = "Constraint forces Rₖ on the particles"
    forces = {
        name: np.stack([table.column(f"R.{name}.{axis}") for axis in "xyz"], axis=1) for name in particles
    }
    lengths = {name: chart.sizes(force) for name, force in forces.items()}
    shown, note = table.acting(lengths)
    unit, count = force_unit(table.units), 3 * len(shown)
    if len(shown) > _FORCE_PANELS:
        curves = [table.curve(name, lengths[name], len(shown)) for name in shown]
        return Band(heading, (table.panel(with_unit("|Rₖ|", unit), curves, is_family=True),), note)
    panels = []
    for name in shown:
        components = zip("xyz", forces[name].T, strict=True)
        curves = [table.curve(f"{a} component", f, count, k) for k, (a, f) in enumerate(components)]
        panels.append(table.panel(with_unit("Rₖ", unit), curves, title=name))
    return Band(heading, tuple(panels), note)


def _coordinate_forces(table: _Table, coordinates: list[str]) -> Band:
    heading = "Generalized constraint forces Qʹⱼ on the coordinates"
    unit = force_unit(table.units, length_power=2)
    are_angles = {dimension_facts.base(name) for name in coordinates} <= table.facts.dimensions.angles
    label = with_unit("Qʹⱼ", unit if are_angles else f"{unit or '1'} / unit of qⱼ")
    forces = {name: table.column(f"R.{name}") for name in coordinates}
    shown, note = table.acting(forces)
    curves = [table.curve(name, forces[name], len(shown)) for name in shown]
    if len(curves) > _FORCE_PANELS:
        return Band(heading, (table.panel(label, curves, is_family=True),), note)
    return Band(heading, tuple(table.panel(label, [curve], title=curve.label) for curve in curves), note)


def are_of_like_size(sizes: Sequence[float]) -> bool:
    """True if curves of these sizes, none of them zero, can be read on common axes."""
    return not sizes or max(sizes) <= _LIKE_SIZE * min(sizes)


def size(values: Floats) -> float:
    """The largest size of values, of which some may be nan; 0 of none."""
    return float(np.nanmax(np.abs(values), initial=0.0))
