"""`lagcli displacements`: what may move, and what forces between particles do."""

from __future__ import annotations

from collections import Counter
from typing import TYPE_CHECKING, Annotated

from lagcli.cli.commands import options
from lagcli.cli.terminal import console, exits
from lagcli.model.settings import RunSettings
from lagcli.output.files import formats

if TYPE_CHECKING:
    from lagcli.analysis.displacement_set import Displacements
    from lagcli.analysis.internal_forces import Internal

MOST_COLUMNS, MOST_LINES = 8, 40  # of a basis, as fit a terminal; and its lines
METRICS = {
    "mass": "orthonormal in the mass metric, dq M dq = 1",
    "plain": "orthonormal with all coordinates weighed the same, as some have no inertia of their own",
}


@options.command("duration", "samples", "output_step")
def displacements(
    model: options.ModelArgument,
    at: Annotated[float | None, options.named("T", "the time to run to; by default the start")] = None,
    *,
    run_settings: RunSettings,
    changes: options.SetOption = None,
    as_json: options.JsonOption = False,
    quiet: options.QuietOption = False,
    verbose: options.VerboseOption = False,
) -> None:
    """Print bases of the allowed and virtual displacements, the dependent and independent components, and whether the
    forces between particles act along lines.

    Exit 3 where the motion stops before T.
    """
    read = options.read(model, changes, as_json)
    from lagcli.api import find_displacements

    with (
        options.refusals(as_json, lambda text: f"--{text}" if text.startswith("at: ") else text),
        options.stops(),
    ):
        found = find_displacements.displacements(read, at, **run_settings)
    if as_json:
        print(formats.json_line(found.as_json()))
    else:
        _print_report(found)
    if not quiet:
        exits.print_err_all(found.assembled.lines(read.units) if found.assembled else ())
    exits.print_notes((f"{note}; displacements do not depend on velocities" for note in found.notes), quiet)
    exits.print_notes(found.contacts.notes, quiet)
    if not found.bases.is_certain:
        note = "the rows are nearly dependent here; the lower of the possible ranks is taken"
        exits.print_notes([note], quiet)


def _print_report(found: Displacements) -> None:
    bases, parts = found.bases, found.components
    n = len(parts.names)
    label = "3N" if n == 3 * len(found.particles) else "n"
    console.paragraph(
        f"t = {found.t:.9g}: {console.counted(n, 'coordinate')}, {console.counted(bases.rows, 'row')} of rank"
        f" {bases.rank}; {label} - rank = {n} - {bases.rank} ="
        f" {console.counted(bases.dimension, 'virtual displacement')}"
    )
    print()
    # Displacements of the coordinates, and of particles that have none of their own
    shown, rows = min(bases.dimension, MOST_COLUMNS), []
    allowed, allowed_r = found.contacts.allowed, found.allowed_r
    for i, name in enumerate(parts.names):
        last = "-" if allowed is None else _entry(allowed[i])
        rows.append([name, *map(_entry, bases.virtual[i, :shown]), last])
    own = {name.rpartition(".")[0] for name in parts.names}
    for k, particle in enumerate(found.particles):
        for j, axis in enumerate("xyz" if particle not in own else ""):
            last = "-" if allowed_r is None else _entry(allowed_r[k, j])
            rows.append([f"{particle}.{axis}", *map(_entry, found.virtual_r[k, j, :shown]), last])
    console.table(["", *(f"δ{i}" for i in range(1, shown + 1)), "allowed"], rows, {})
    print()
    console.paragraph(f"δ1, δ2, ...: a basis of the virtual displacements (D.9), {METRICS[bases.metric]}")
    if allowed is None or allowed_r is None:
        sentence = "allowed: none is told; a note says why"
    elif found.contacts.are_closed:
        sentence = (
            "allowed: the shortest displacement over dt = 1 that rows (D.6) and closed contacts, G dr + g_t dt >= 0,"
            " leave; adding free and one-sided ones gives others"
        )
    elif allowed.any() or allowed_r.any():
        sentence = (
            "allowed: a displacement over dt = 1, the shortest in that metric; adding virtual ones gives all allowed"
            " displacements (D.6)"
        )
    else:
        sentence = "nothing is driven at this instant: the allowed displacements (D.6) are the virtual ones"
    console.paragraph(sentence)
    console.paragraph(
        f"|B δr| <= {bases.residual:.1e}, |B dr + b dt| <= {bases.allowed_residual:.1e} for rows of length one"
    )
    if bases.dimension > MOST_COLUMNS:
        console.paragraph(f"{bases.dimension - MOST_COLUMNS} more of the basis are given with --json")
    print()
    if found.contacts.contacts:
        _contacts(found)
        print()
    # The independent components, and the others by them
    for kind, indices in (("independent", parts.independent), ("dependent", parts.dependent)):
        names = []
        for i in indices[:MOST_LINES]:
            number = parts.numbers[i]
            names.append(parts.names[i] if number is None else f"x_{number} = {parts.names[i]}")
        more = f" and {len(indices) - MOST_LINES} more" if len(indices) > MOST_LINES else ""
        console.paragraph(f"{kind}: {', '.join(names) or 'none'}{more}")
    for row, index in list(enumerate(parts.dependent))[:MOST_LINES]:
        pairs = zip(parts.T[row], parts.independent, strict=True)
        terms = [(value, f"d{parts.names[i]}") for value, i in pairs]
        line = f"    d{parts.names[index]} = {_sum([*terms, (parts.tau[row], 'dt')])}"
        console.paragraph(line, "        ")
    print()
    _forces(found.internal)


def _contacts(found: Displacements) -> None:
    """The contacts with their sides, and the directions that the closed ones leave."""
    contacts, names = found.contacts.contacts, found.components.names
    rows = []
    for one in sorted(contacts, key=lambda one: one.state == "open"):
        terms = [(float(value), f"d{name}") for value, name in zip(one.gradient, names, strict=True)]
        condition = f"{_sum([*terms, (one.rate, 'dt')])} >= 0" if one.state == "closed" else ""
        rows.append([one.name, one.state, condition])
    _first_lines(["contact", "state", "leaves"], rows)
    directions = found.contacts.directions
    if directions is None or not any(one.state == "closed" for one in contacts):
        return
    print()
    console.paragraph(
        "what closed contacts leave of the virtual displacements: free ones go both ways, one-sided ones open the"
        " contacts that are named, blocked ones would violate them (G δr >= 0)"
    )
    several = directions[:MOST_COLUMNS]
    table = [[names[i], *(_entry(one.displacement[i]) for one in several)] for i in range(len(names))]
    table.append(["contacts", *(", ".join(one.contacts) for one in several)])
    console.table(["", *(one.kind for one in several)], table, {})
    if len(directions) > MOST_COLUMNS:
        counts = Counter(one.kind for one in directions)
        told = ", ".join(f"{counts[kind]} {kind}" for kind in counts)
        print(f"{told}: {len(directions) - MOST_COLUMNS} more are given with --json")


def _sum(terms: list[tuple[float, str]]) -> str:
    text = ""
    for value, name in terms:
        if value:
            sign = (" - " if value < 0 else " + ") if text else ("-" if value < 0 else "")
            size = f"{abs(value):.6g} "
            text += f"{sign}{'' if size == '1 ' else size}{name}"
    return text or "0"


def _forces(found: tuple[Internal, ...]) -> None:
    """The forces between particles."""
    if not found:
        print("no forces between particles are declared")
        return
    rows = []
    for one in found:
        force, verdict = one.force, "of several; balanced" if one.is_central else "of several; not balanced"
        if one.is_pair:
            force, verdict = one.force / 2, "central" if one.is_central else "not central"
        names = [", ".join(one.laws), ", ".join(one.particles)]
        rows.append([*names, f"{force:.6g}", f"{one.unbalanced:.1e}", f"{one.off_line:.1e}", verdict])
    _first_lines(["internal force", "between", "size", "F_ij + F_ji", "off the line", "verdict"], rows)
    if any(not one.is_central for one in found):
        print()
        console.paragraph(
            "forces that are not central do virtual work on a rigid body: the limit of stiff springs does not"
            " apply to them"
        )


def _first_lines(headers: list[str], rows: list[list[str]]) -> None:
    """A table, of which a terminal has room for the first lines."""
    console.table(headers, rows[:MOST_LINES], {})
    if len(rows) > MOST_LINES:
        print(f"{len(rows) - MOST_LINES} more are given with --json")


def _entry(value: float) -> str:
    return "0" if abs(value) < 1e-14 else f"{value:.6g}"
