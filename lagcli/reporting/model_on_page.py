"""The blocks of a report that every format of it can write, and a model as such blocks: its declarations and its text.
All texts are plain, and the writers escape every one; only `PageEquations` holds markup, which `derive` has made."""

from __future__ import annotations

import dataclasses
import functools
import re
from collections.abc import Callable, Iterable, Iterator, Sequence
from typing import TYPE_CHECKING, Literal

import numpy as np

from lagcli import yaml_tree
from lagcli.arrays import Floats
from lagcli.errors import diagnostics
from lagcli.model import model as nouns
from lagcli.model.family import Family
from lagcli.model.model import Model, Vector3, VectorExpression

if TYPE_CHECKING:
    from lagcli.output.figures.figure_page import PlainFigure


# Rows of a table, and letters of a cell: a page with more is not read.
MOST_ROWS, MOST_CELL = 60, 300
# Lines and letters of a line that a page shows: more is a file to be looked into, and its hash names it.
MOST_LINES, MOST_IN_LINE = 400, 2000
# Letters of a text whose pieces are looked for: a page of more shows it plain.
MOST_MARKED = 200_000
TAB = 8  # columns between the stops of a tabulator
COMMENT = re.compile(r"(?:(?<=\s)|(?<!.))#[^\n]*")
# Bytes of a drawing in lines; one of more is painted in points, which are never so many.
MOST_DRAWN = 600_000


def tables(model: Model) -> Iterator[PageTable]:
    """The tables that have rows, in the order of the file's sections."""
    length, mass, time = model.units.length, model.units.mass, model.units.time
    changed = {name.partition(".")[0] for name, _ in model.changes}
    parameters = []
    for parameter in model.parameters:
        # Parameters made from expressions show them; the value is the one of this run.
        value = _value(parameter.value)
        formula = parameter.formula.text if parameter.formula is not None else ""
        whence = "--set" if parameter.name in changed else formula * (formula != value)
        parameters.append((parameter.name, value, whence))
    yield from _table("Parameters", ("name", "value", "from"), parameters, {0, 2})
    coordinates = [(_label(c.members), _range(c.value), _range(c.rate)) for c in model.coordinates]
    yield from _table("Coordinates", ("name", "at the start", "rate at the start"), coordinates, {0})
    particles = []
    for particle in model.particles:
        masses, is_one = _range(particle.mass_values), particle.members.count == 1
        particles.append(
            (
                _label(particle.members),
                masses if particle.mass.text == masses else f"{particle.mass.text} = {masses}",
                _vector(particle.position) if particle.is_dependent or particle.members.count > 1 else "",
                _point(particle.start) if is_one else "",
                _point(particle.start_velocity) if is_one and not particle.is_dependent else "",
            )
        )
    at_start = _with("at the start", length)
    speed = _with("velocity at the start", f"{length}/{time}" if length and time else "")
    yield from _table(
        "Particles", ("name", _with("mass", mass), "position", at_start, speed), particles, {0, 1, 2}
    )
    definitions = [(d.name, d.expression.text) for d in model.definitions]
    yield from _table("Definitions", ("name", "expression"), definitions, {0, 1})
    lagrangian = [("", "Lagrangian", model.lagrangian.text)] if model.lagrangian is not None else []
    yield from _table("Forces", ("name", "on", "expression"), (*lagrangian, *_forces(model)), {0, 2})
    yield from _table("Constraints", ("name", "declared", "equation or condition"), _laws(model), {0, 2})
    outputs = [(_label(o.members), o.expression.text) for o in model.outputs]
    yield from _table("Outputs", ("name", "expression"), outputs, {0, 1})
    headers = ("name", "where this crosses zero", "direction", "action")
    events = [(e.name, e.when.text, e.direction, e.action) for e in model.events]
    yield from _table("Events", headers, events, {0, 1})


def _table(
    caption: str, headers: tuple[str, ...], rows: Iterable[Sequence[str]], code: set[int]
) -> Iterator[PageTable]:
    """The table without the columns in which nothing stands; none where there are no rows."""
    found = []
    for row in rows:
        plain = (" ".join(diagnostics.printable(cell).split()) for cell in row)
        found.append(tuple(cell if len(cell) <= MOST_CELL else f"{cell[:MOST_CELL]} …" for cell in plain))
    if not found:
        return
    filled = [i for i in range(len(headers)) if any(row[i] for row in found)]
    renumbered = {old: new for new, old in enumerate(filled)}
    shown = [tuple(row[i] for i in filled) for row in found[:MOST_ROWS]]
    caption += part(len(found))
    yield PageTable(
        tuple(headers[i] for i in filled),
        tuple(shown),
        frozenset(renumbered[i] for i in code if i in renumbered),
        caption,
    )


def part(count: int) -> str:
    """What the caption of a table says of its rows, where it shows the first ones."""
    return f" (the first {MOST_ROWS} of {count})" if count > MOST_ROWS else ""


def _forces(model: Model) -> Iterator[tuple[str, str, str]]:
    for force in model.forces:
        match force:
            case nouns.ParticleForce():
                targets = _named(model.particle_names, np.unique(force.action.targets))
                yield _label(force.members), targets, _vector(force.force)
            case nouns.GeneralizedForce():
                targets = _named(model.generalized_names, np.unique(force.action.targets))
                yield _label(force.members), targets, force.force.text
            case nouns.Potential():
                yield _label(force.members), "potential", force.expression.text


def _laws(model: Model) -> Iterator[tuple[str, str, str]]:
    for law in model.constraints():
        if isinstance(law, nouns.RigidBody):
            yield law.name, "rigid", _named(model.particle_names, law.particles)
        else:
            declared = type(law).__name__.lower()
            restitution = _range(law.restitution) if isinstance(law, nouns.Inequality) else "0"
            law_text = law.equation.text + (f", restitution {restitution}" if restitution != "0" else "")
            yield _label(law.members), declared, law_text


def _label(members: Family) -> str:
    if members.count == 1:
        return members.names[0]
    if not members.count:
        return f"{members.base} (no members)"
    return f"{members.names[0]} … {members.names[-1]} ({members.count})"


def _named(names: Sequence[str], indices: Iterable[int]) -> str:
    found = [names[int(i)] for i in indices]
    if len(found) == len(names) > 1:
        return "all"
    return diagnostics.first_of(found, "more")


def _vector(expression: VectorExpression) -> str:
    parts = [part.text for part in expression.parts]
    return parts[0] if len(parts) == 1 else f"[{', '.join(parts)}]"


def _value(value: float | Vector3) -> str:
    return f"[{', '.join(f'{part:.9g}' for part in value)}]" if isinstance(value, tuple) else f"{value:.9g}"


def _range(values: Floats) -> str:
    if not len(values):
        return ""
    low, high = float(values.min()) + 0.0, float(values.max()) + 0.0
    return f"{low:.9g}" if low == high else f"{low:.6g} to {high:.6g}"


def _point(values: Floats | None) -> str:
    return "" if values is None else f"[{', '.join(f'{part + 0.0:.6g}' for part in values[0])}]"


def _with(words: str, unit: str) -> str:
    return f"{words} ({unit})" if unit.strip() else words


def listing(text: str, name: str) -> PageListing:
    """The lines of the text of a model that has been read."""
    whole = text.replace("\r\n", "\n").replace("\r", "\n")
    lines = whole.rstrip("\n").split("\n")
    caption = f"{name}, {len(lines)} line{'s' * (len(lines) != 1)}"
    if len(lines) > MOST_LINES:
        caption += f", of which the first {MOST_LINES} are shown"
    shown = "\n".join(lines[:MOST_LINES])
    found: list[list[tuple[str, str]]] = [[]]
    for look, stretch in _pieces(shown, _marks(whole, name) if len(whole) <= MOST_MARKED else []):
        first, *rest = stretch.split("\n")
        found[-1].append((look, first))
        found += [[(look, part)] for part in rest]
    return PageListing(tuple(map(_cut, found)), caption)


def _marks(text: str, name: str) -> list[tuple[int, int, str]]:
    """Stretches of the text with a look, in order and apart from each other."""
    found: list[tuple[int, int, str]] = []
    taken: list[tuple[int, int]] = []
    waiting: list[yaml_tree.AnyNode] = [yaml_tree.parse(text, name)]
    while waiting:
        match waiting.pop():
            case yaml_tree.Scalar() as one:
                taken.append((one.start, one.end))
            case yaml_tree.Sequence() as several:
                waiting += several.items
            case yaml_tree.Mapping() as entries:
                for key, value in entries:
                    taken.append((key.start, key.end))
                    found.append((key.start, key.end, "key"))
                    waiting.append(value)
    taken.sort()
    # What stands between scalars is punctuation, and comments.
    for (_, begin), (end, _) in zip([(0, 0), *taken], [*taken, (len(text), 0)], strict=True):
        for comment in COMMENT.finditer(text, begin, max(begin, end)):
            found.append((*comment.span(), "comment"))
    return sorted(found)


def _pieces(shown: str, marks: list[tuple[int, int, str]]) -> Iterator[tuple[str, str]]:
    """The whole text in pieces with their looks."""
    at = 0
    for start, end, look in marks:
        yield "", shown[at:start]
        yield look, shown[max(at, start) : end]
        at = max(at, end)
    yield "", shown[at:]


def _cut(pieces: list[tuple[str, str]]) -> tuple[tuple[str, str], ...]:
    """The pieces of a line as they are printed, as many letters as have room."""
    cut: list[tuple[str, str]] = []
    room = MOST_IN_LINE
    for look, piece in pieces:
        if piece and room >= 0:
            plain = diagnostics.printable(piece.replace("\t", " " * TAB).replace("\xa0", " "))
            cut.append((look, plain if len(plain) <= room else f"{plain[:room]} …"))
            room -= len(plain)
    return tuple(cut)


@dataclasses.dataclass(frozen=True, slots=True)
class PageTable:
    """A table; `code`: numbers of the columns that hold what was typed, `caption`: what it is a table of, `failures`:
    numbers of the rows that tell of a failure."""

    headers: tuple[str, ...]
    rows: tuple[tuple[str, ...], ...]
    code: frozenset[int] = frozenset()
    caption: str = ""
    failures: frozenset[int] = frozenset()
    kind: Literal["table"] = "table"


@dataclasses.dataclass(frozen=True, slots=True)
class PageSentences:
    """Sentences, one below the other."""

    lines: tuple[str, ...]
    kind: Literal["sentences"] = "sentences"


@dataclasses.dataclass(frozen=True, slots=True)
class PageListing:
    """The text of a file in lines, each of which is a list of pieces: their look (``key``, ``comment`` or nothing) and
    their text. `caption` says what it is."""

    lines: tuple[tuple[tuple[str, str], ...], ...]
    caption: str
    kind: Literal["listing"] = "listing"

    @property
    def text(self) -> str:
        """The lines as they were written."""
        return "\n".join("".join(piece for _, piece in line) for line in self.lines)


@dataclasses.dataclass(frozen=True, slots=True)
class PageFigure:
    """A picture: its name as a part of a file name, its format (svg or png), its bytes; `words`: what it shows, for
    those who do not see it; pdf: makes it as PDF."""

    name: str
    ending: Literal["svg", "png"]
    content: bytes
    words: str
    pdf: Callable[[], bytes]
    kind: Literal["figure"] = "figure"


@dataclasses.dataclass(frozen=True, slots=True)
class PageEquations:
    """Equations as parts of a page in HTML, in Markdown and in LaTeX; markup that needs no escaping."""

    html: str
    markdown: str
    latex: str
    kind: Literal["equations"] = "equations"


Block = PageTable | PageSentences | PageListing | PageFigure | PageEquations


@dataclasses.dataclass(frozen=True, slots=True)
class PageSection:
    """Blocks under a title; `anchor` is its name in links."""

    title: str
    anchor: str
    blocks: tuple[Block, ...]


@dataclasses.dataclass(frozen=True, slots=True)
class ReportContents:
    """The page: its title, sentences about it, what is wrong (`failures`), what is open (`open_questions`), the outcome
    in a few lines (`summary`: label and value), and the sections."""

    title: str
    about: tuple[str, ...]
    failures: tuple[str, ...]
    open_questions: tuple[str, ...]
    summary: tuple[tuple[str, str], ...]
    sections: tuple[PageSection, ...]

    @property
    def figures(self) -> tuple[PageFigure, ...]:
        """All pictures, in their order."""
        return tuple(b for section in self.sections for b in section.blocks if isinstance(b, PageFigure))


def picture(name: str, drawn: PlainFigure, words: str) -> PageFigure:
    """The picture of a figure; `words`: what it shows."""
    # A page is written without matplotlib.
    from lagcli.output.figures import figure_page

    lines = figure_page.content("svg", drawn)
    pdf = functools.partial(figure_page.content, "pdf", drawn)
    if len(lines) <= MOST_DRAWN:
        return PageFigure(name, "svg", lines, words, pdf)
    return PageFigure(name, "png", figure_page.content("png", drawn), words, pdf)
