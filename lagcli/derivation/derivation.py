"""A built system -> the page with its equations of motion."""

from __future__ import annotations

import collections
import dataclasses
from collections.abc import Iterable, Iterator

from lagcli import progress
from lagcli.derivation.sections import linear_section, page_sections, solution_sections
from lagcli.derivation.sections.derivation_page import Derivation, Line, Section
from lagcli.derivation.sections.linear_section import LinearPoint
from lagcli.derivation.sections.one_sided_sections import OneSided
from lagcli.derivation.symbolic.signs import Signs
from lagcli.derivation.symbolic.symbolic_system import symbolic
from lagcli.derivation.writing import formula as f
from lagcli.equations.system import System
from lagcli.errors import diagnostics
from lagcli.model import settings
from lagcli.pfaffian.exact import time_limit
from lagcli.pfaffian.exact.guarded import TooDeep

SHOWN, TERMS = 2, 16  # lines of a family that are shown before the last one; terms of a long sum


@dataclasses.dataclass(frozen=True, slots=True)
class Options:
    """solve: lambda and accelerations in closed form. everything: all members of families, all terms of sums. values:
    parameters to put in as numbers. limit: in seconds. about: the point of the linear equations, if they are wanted."""

    solve: bool = False
    everything: bool = False
    values: frozenset[str] = frozenset()
    limit: float = settings.LIMIT
    about: LinearPoint | None = None


def derive(built: System, options: Options) -> Derivation:
    """The equations of motion. Raises `diagnostics.ModelError` for what is too large to be written out."""
    hint = ""
    try:
        return time_limit.run(progress.after(options.limit), lambda: _derived(built, options))
    except (RecursionError, TooDeep):
        reason = "an expression is nested too deeply"
    except time_limit.TimeUpError:
        reason = f"it takes longer than {progress.told(options.limit)}"
        hint = "`--limit SECONDS` gives it more time"
    where = diagnostics.Location(built.model.path, 1, 1)
    message = f"the equations cannot be written out: {reason}"
    raise diagnostics.error("too-large-to-derive", message, where, hint)


def _derived(built: System, options: Options) -> Derivation:
    model = built.model
    system = symbolic(model, built.bodies, options.values)
    signs = Signs(system)
    parts = page_sections.Sections(system, signs)
    contacts = OneSided(system, signs, parts)
    has_rows = system.rows or system.contacts.rows
    # The constraints come first on the page; lengths are only known when all else is written.
    drafts: list[tuple[str, Iterable[Line]]] = [
        ("Positions", parts.positions()),
        ("Constraints", parts.constraints()),
        ("Inequalities", contacts.conditions()),
        ("Rows", (*(parts.rows() if system.rows else ()), *contacts.rows())),
        ("Constraint forces", parts.reactions() if has_rows else ()),
        ("Energies", parts.energies()),
        ("Generalized forces", parts.forces()),
        ("Newton's equations", parts.newton()),
        ("Inertia", parts.inertia()),
        ("Lagrange's equations", parts.lagrange()),
        ("From Newton to Lagrange", parts.identity()),
        ("Points of rest  F + Bᵀλ = 0", parts.points_of_rest()),
    ]
    written = [(title, list(lines)) for title, lines in drafts]
    if options.about is not None:
        written.append((linear_section.TITLE, list(linear_section.lines(system, signs, options.about))))
    written += solution_sections.sections(system, parts, contacts, options.solve)
    written.append((page_sections.VAKONOMIC, list(page_sections.vakonomic(system, signs))))
    lengths = list(parts.lengths())
    index = next((i for i, (title, lines) in enumerate(written) if title == "Constraints" and lines), None)
    if lengths and index is not None:
        written[index][1].extend(lengths)
    elif lengths:
        written.insert(0, ("Lengths", lengths))
    # Parameters that stand as numbers, and the constants of rigid bodies
    substituted = []
    for name, value in system.table.substituted.items():
        left = f.FormulaText(name)
        right = f.Triple(tuple(map(signs.node, value))) if isinstance(value, tuple) else signs.node(value)
        substituted.append(Line(sides=(left, right), kind="value"))
    for symbol, number in system.table.body_constants.items():
        body = symbol.name.split(" ")[1]
        sides = signs.node(symbol), f.FormulaNumber(f"{number:.10g}")
        substituted.append(Line(sides=sides, kind="constant", family=body))
    if substituted:
        written.insert(0, ("Values put in", substituted))
    shown = ((title, lines if options.everything else _cut(lines)) for title, lines in written if lines)
    sections = tuple(Section(title, tuple(lines)) for title, lines in shown)
    # No title, whatever characters it has, steers a terminal or leaves its line.
    title = " ".join(diagnostics.printable(model.title or "Equations of motion").split())
    particles, rows, inequalities = len(system.table.particles), len(system.rows), len(system.contacts.rows)
    counts = [
        f"{particles} particle{'s' * (particles != 1)}" if particles else "",
        f"{len(system.q)} coordinate{'s' * (len(system.q) != 1)}",
        f"{rows} constraint row{'s' * (rows != 1)}",
        f"{inequalities} inequalit{'ies' if inequalities > 1 else 'y'}" if inequalities else "",
    ]
    counted = ", ".join(filter(None, counts))
    about = f"{counted}. (D.n): `lagcli explain D.n` says what each equation is."
    return Derivation(title, about, sections, system)


def _cut(lines: list[Line]) -> Iterator[Line]:
    """The lines, of each family the first ones and the last, with what was left out; of long sums some terms too."""
    counts = collections.Counter((line.kind, line.family) for line in lines if line.family)
    seen = collections.Counter[tuple[str, str]]()
    for line in lines:
        group = line.kind, line.family
        seen[group] += 1
        if counts[group] <= SHOWN + 3 or not SHOWN < seen[group] < counts[group]:
            yield dataclasses.replace(line, sides=tuple(map(_shortened, line.sides)))
        elif seen[group] == SHOWN + 1:
            yield Line(note=f"… {counts[group] - SHOWN - 1} lines like these left out; --all shows them")


def _shortened(node: f.FormulaNode) -> f.FormulaNode:
    """A long sum with its first terms and its last one."""
    if isinstance(node, f.FormulaProduct):
        return f.FormulaProduct(tuple(map(_shortened, node.factors)))
    if not isinstance(node, f.FormulaSum) or len(node.terms) <= TERMS:
        return node
    gone = len(node.terms) - 4
    return f.FormulaSum((*node.terms[:3], (1, f.FormulaText(f"… ({gone} terms left out)")), node.terms[-1]))
