"""A built system -> the page with its equations of motion."""

from __future__ import annotations

import dataclasses
from collections.abc import Iterable, Iterator

import sympy

from lagcli.derivation.sections import linear_section, statics_section, vakonomic_sections
from lagcli.derivation.sections.derivation_page import Derivation, Line, Section
from lagcli.derivation.sections.one_sided_sections import TITLE, OneSided
from lagcli.derivation.sections.page_sections import Sections, joined, triple
from lagcli.derivation.sections.vakonomic_sections import Vakonomic
from lagcli.derivation.symbolic import closed_form, multiplier_equations
from lagcli.derivation.symbolic.calculus import ZERO
from lagcli.derivation.symbolic.linear_matrices import LinearPoint
from lagcli.derivation.symbolic.signs import Signs
from lagcli.derivation.symbolic.symbolic_system import Symbolic, symbolic
from lagcli.derivation.symbolic.tidy import polynomial, tidy
from lagcli.derivation.symbolic.vectors import NOTHING
from lagcli.derivation.writing import formula as f
from lagcli.equations.system import System
from lagcli.errors import diagnostics
from lagcli.model import settings
from lagcli.pfaffian.exact import time_limit
from lagcli.pfaffian.exact.sympy_failure import TooDeep

# Of a family this many lines are shown, then the last one; of a long sum this many terms.
SHOWN, TERMS = 2, 16
# Operations up to which lambda is put into accelerations.
SHORT = 16
# Contacts of which each is shown closed alone.
MOST_CLOSED = 3
# Operations up to which a component of an acceleration is written with a longer lambda put in.
COMPONENT = 40


@dataclasses.dataclass(frozen=True, slots=True)
class Options:
    """solve: lambda and accelerations in closed form. everything: all members of families, all terms of sums.
    values: parameters that are put in as numbers. limit: seconds for it. about: the point of the linear equations,
    which are left out without one."""

    solve: bool = False
    everything: bool = False
    values: frozenset[str] = frozenset()
    limit: float = settings.LIMIT
    about: LinearPoint | None = None


def derive(built: System, options: Options) -> Derivation:
    """The equations of motion. Raises `diagnostics.ModelError` for what is too large to be written out."""
    try:
        return time_limit.run(time_limit.after(options.limit), lambda: _derived(built, options))
    except (RecursionError, TooDeep):
        raise _too_large(built, "an expression is nested too deeply") from None
    except time_limit.TimeUpError:
        hint = "`--limit SECONDS` gives it more time"
        raise _too_large(built, f"it takes longer than {options.limit:g} s", hint) from None


def _too_large(built: System, reason: str, hint: str = "") -> diagnostics.ModelError:
    message = f"the equations cannot be written out: {reason}"
    where = diagnostics.Location(built.model.path, 1, 1)
    return diagnostics.ModelError([diagnostics.Diagnostic("too-large-to-derive", message, where, hint)])


def _derived(built: System, options: Options) -> Derivation:
    model = built.model
    system = symbolic(model, built.bodies, options.values)
    signs = Signs(system)
    parts = Sections(system, signs)
    contacts = OneSided(system, signs, parts)
    held = system.rows or system.contacts.rows
    # The constraints come first on the page; lengths are only known when all else is written.
    drafts: list[tuple[str, Iterable[Line]]] = [
        ("Positions", parts.positions()),
        ("Constraints", parts.constraints()),
        ("Inequalities", contacts.conditions()),
        ("Rows", (*(parts.rows() if system.rows else ()), *contacts.rows())),
        ("Constraint forces", parts.reactions() if held else ()),
        ("Energies", parts.energies()),
        ("Generalized forces", parts.forces()),
        ("Newton's equations", parts.newton()),
        ("Inertia", parts.inertia()),
        ("Lagrange's equations", parts.lagrange()),
        ("From Newton to Lagrange", parts.identity()),
        (statics_section.TITLE, statics_section.lines(system, parts)),
    ]
    written = [(title, list(lines)) for title, lines in drafts]
    if options.about is not None:
        written.append((linear_section.TITLE, list(linear_section.lines(system, signs, options.about))))
    written += _multipliers(system, parts, contacts, options)
    written.append((vakonomic_sections.TITLE, list(Vakonomic(system, signs, parts).lines())))
    lengths = list(parts.lengths())
    place = next((i for i, (title, lines) in enumerate(written) if title == "Constraints" and lines), None)
    if lengths and place is not None:
        written[place][1].extend(lengths)
    elif lengths:
        written.insert(0, ("Lengths", lengths))
    if said := _constants(system, signs):
        written.insert(0, ("Values put in", said))
    sections = tuple(Section(title, tuple(_cut(lines, options))) for title, lines in written if lines)
    # No title, whatever characters it has, steers a terminal or leaves its line.
    title = " ".join(diagnostics.printable(model.title or "Equations of motion").split())
    return Derivation(title, _about(system), sections, system)


def _about(system: Symbolic) -> str:
    particles, rows = len(system.world.particles), len(system.rows)
    contacts = len(system.contacts.rows)
    counts = [
        f"{particles} particle{'s' * (particles != 1)}" if particles else "",
        f"{len(system.q)} coordinate{'s' * (len(system.q) != 1)}",
        f"{rows} constraint row{'s' * (rows != 1)}",
        f"{contacts} inequalit{'ies' if contacts > 1 else 'y'}" if contacts else "",
    ]
    said = ", ".join(part for part in counts if part)
    return f"{said}. (D.n): `lagcli explain D.n` says what each equation is."


def _constants(system: Symbolic, signs: Signs) -> list[Line]:
    """Parameters that stand as numbers, and the constants of rigid bodies."""
    found = []
    for name, value in system.world.substituted.items():
        left = f.FormulaWords(name)
        right = f.Triple(tuple(map(signs.node, value))) if isinstance(value, tuple) else signs.node(value)
        found.append(Line(sides=(left, right), kind="value"))
    for symbol, number in system.constants.items():
        body = symbol.name.split(" ")[1]
        found.append(
            Line(sides=(signs.node(symbol), f.FormulaNumber(f"{number:.10g}")), kind="constant", family=body)
        )
    return found


def _multipliers(
    system: Symbolic, parts: Sections, contacts: OneSided, options: Options
) -> list[tuple[str, list[Line]]]:
    """The equation for lambda (D.24), what contacts and impacts ask for, and solutions where they are asked for."""
    every = system.all_closed
    if not every.rows:
        return [("Solution", list(_without_rows(system, parts)))] if options.solve else []
    title = "Multiplier equation  (B M⁻¹ Bᵀ) λ = γ − B M⁻¹ h"
    lines = list(parts.gammas())
    inverted = multiplier_equations.inverse(system)
    equation = None
    if inverted.entries is not None:
        equation = multiplier_equations.equation(every, inverted.entries)
        for r, row in enumerate(system.rows):
            terms = (equation.S.get((r, j), ZERO) * lam for j, lam in enumerate(every.lam))
            sides = parts.signs.node(sum(terms, ZERO)), parts.signs.node(equation.right[r])
            lines.append(Line("D.24", sides, kind="S", family=row.family))
    elif system.rows:
        lines.append(Line(note=f"B M⁻¹ Bᵀ is not written out: {inverted.reason}."))
    found = [(title, lines), (TITLE, list(contacts.contact(equation))), ("Impact", list(contacts.impact()))]
    if options.solve and equation is None:
        note = f"λ in closed form is not written out: {inverted.reason}."
        found.append(("Solution", [Line(note=note)]))
    elif options.solve:
        found += _solutions(system, parts, contacts, inverted)
    return found


def _solutions(
    system: Symbolic, parts: Sections, contacts: OneSided, inverted: multiplier_equations.Inverse
) -> Iterator[tuple[str, list[Line]]]:
    """Solutions with all contacts open, and with each of the first few closed alone."""
    assert inverted.entries is not None
    names = [row.name for row in system.contacts.rows]
    for closed in ((), *((j,) for j in range(min(len(names), MOST_CLOSED)))):
        mode = system.closed(closed)
        own = Sections(mode, parts.signs) if names else parts
        while_ = f" while {names[closed[0]]} alone is closed" if closed else " while all contacts are open"
        title = f"Solution{while_ if names else ''}"
        if not mode.rows:
            yield title, list(_accelerations(mode, own, inverted, closed_form.ClosedForm({}, "", {}), {}))
            continue
        equation = multiplier_equations.equation(mode, inverted.entries)
        lines = list(_solution(mode, own, equation, inverted))
        if closed:
            whole = multiplier_equations.equation(system.all_closed, inverted.entries)
            lines += contacts.alone(closed[0], whole, closed_form.surface(mode))
        yield title, lines
    if len(names) > MOST_CLOSED:
        yield (
            "Other solutions",
            [Line(note=f"Of {len(names)} contacts the first {MOST_CLOSED} are shown closed.")],
        )


def _solution(
    system: Symbolic,
    parts: Sections,
    equation: multiplier_equations.Equation,
    inverted: multiplier_equations.Inverse,
) -> Iterator[Line]:
    signs = parts.signs
    solved = closed_form.solve(system, equation)
    if not solved.values:
        yield Line(note=f"No closed form: {solved.reason}.")
        return
    said = [(x, value) for x, value in solved.on.items() if not str(x).startswith("product ")]
    if said:
        left, right = (tuple(map(signs.node, side)) for side in zip(*said, strict=True))
        yield Line(note="On the constraints, where")
        yield Line(sides=(left[0], right[0]) if len(said) == 1 else (f.Triple(left), f.Triple(right)))
    for r, value in solved.values.items():
        yield Line("D.24", (signs.node(system.lam[r]), signs.node(value)), kind="lambda")
    if solved.reason:
        yield Line(note=f"No closed form of the others: {solved.reason}.")
    put = {system.lam[r]: value for r, value in solved.values.items()}
    yield from _accelerations(system, parts, inverted, solved, put)


def _without_rows(system: Symbolic, parts: Sections) -> Iterator[Line]:
    """Accelerations where nothing constrains them."""
    inverted = multiplier_equations.inverse(system)
    if inverted.entries is None:
        yield Line(note=f"Accelerations in closed form are not written out: {inverted.reason}.")
        return
    yield Line(note="There is no constraint row, and so no multiplier.")
    yield from _accelerations(system, parts, inverted, closed_form.ClosedForm({}, "", {}), {})


def _accelerations(
    system: Symbolic,
    parts: Sections,
    inverted: multiplier_equations.Inverse,
    solved: closed_form.ClosedForm,
    put: dict[sympy.Symbol, sympy.Expr],
) -> Iterator[Line]:
    """Accelerations, with lambda put in where that stays short."""
    signs = parts.signs
    lengths = {x: value for x, value in solved.on.items() if str(x).startswith("root ")}
    h = list(system.h)
    for row, lam in zip(system.rows, system.lam, strict=True):
        for i, slope in row.B.items():
            h[i] += slope * lam
    for number in system.newton:
        first, mass = system.place(number), system.world.mass(number)
        x, y, z = (tidy(value / mass) for value in triple(system.h, first))
        # A long lambda stays a lambda.
        short = {lam for lam in system.lam if lam in put and put[lam].count_ops() <= SHORT}
        factors = [tidy((put[lam] if lam in short else lam) / mass) for lam in system.lam]
        terms = [] if (x, y, z) == NOTHING else signs.scaled(sympy.Integer(1), (x, y, z))
        terms += parts.reaction(first, factors, lengths)
        left = signs.of_particle("r", system.world.particles.names[number], dots=2)
        yield Line("D.23", (left, joined(terms)), kind="acceleration")
        long = set(system.lam) & set().union(*(h[i].free_symbols for i in range(first, first + 3))) - short
        if long and long <= put.keys():
            for i in range(first, first + 3):
                value = _closed(system, h[i].xreplace(put) / mass, solved.on)
                if value.count_ops() <= COMPONENT:
                    yield Line("D.23", (signs.node(system.a[i]), signs.node(value)), kind="component")
    assert inverted.entries is not None
    for i in system.lagrange:
        value = sum((inverted.entries.get((i, j), ZERO) * h[j] for j in system.lagrange), ZERO)
        whole = _closed(system, value.xreplace(put), solved.on)
        if whole.count_ops() > closed_form.MAX_OPERATIONS:
            whole = tidy(value)
        driven = any(system.Q.get(j, ZERO) != 0 for j in system.lagrange)
        equation = "D.53" if system.rows else "D.34" if driven else "D.39"
        yield Line(equation, (signs.node(system.a[i]), signs.node(whole)), kind="acceleration")


def _closed(system: Symbolic, value: sympy.Expr, on: dict[sympy.Symbol, sympy.Expr]) -> sympy.Expr:
    """The form of an acceleration that reads best, with what the rows say put in."""
    whole = tidy(closed_form.put(system, value, on))
    small = whole.count_ops() <= 2 * closed_form.MAX_OPERATIONS
    found = closed_form.cancelled(whole, system.v) if small else []
    return min(*found, polynomial(whole, system.v), whole, key=closed_form.burden)


def _cut(lines: list[Line], options: Options) -> Iterator[Line]:
    """The lines, of each family the first and the last ones, with what was left out."""
    if options.everything:
        yield from lines
        return
    groups: dict[tuple[str, str], list[int]] = {}
    for place, line in enumerate(lines):
        if line.family:
            groups.setdefault((line.kind, line.family), []).append(place)
    left_out: dict[int, str] = {}
    dropped = set[int]()
    for places in groups.values():
        if len(places) > SHOWN + 3:
            gone = places[SHOWN:-1]
            left_out[gone[0]] = f"… {len(gone)} lines like these left out; --all shows them"
            dropped.update(gone)
    for place, line in enumerate(lines):
        if place in left_out:
            yield Line(note=left_out[place])
        if place not in dropped:
            yield dataclasses.replace(line, sides=tuple(map(_shortened, line.sides)))


def _shortened(node: f.FormulaNode) -> f.FormulaNode:
    """A long sum with its first terms and its last one."""
    if isinstance(node, f.FormulaProduct):
        return f.FormulaProduct(tuple(map(_shortened, node.factors)))
    if not isinstance(node, f.FormulaSum) or len(node.terms) <= TERMS:
        return node
    gone = len(node.terms) - 4
    return f.FormulaSum((*node.terms[:3], (1, f.FormulaWords(f"… ({gone} terms left out)")), node.terms[-1]))
