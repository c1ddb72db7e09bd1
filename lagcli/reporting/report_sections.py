"""The sections of a report, made from the answers of the commands: check, simulate, audit, derive."""

from __future__ import annotations

import collections
import dataclasses
from collections.abc import Iterator

from lagcli.analysis import check_report
from lagcli.analysis.check_report import Report
from lagcli.auditing.checks import audit_report
from lagcli.auditing.checks.audit_report import Audit
from lagcli.errors import diagnostics
from lagcli.linear import independent_rows
from lagcli.model.model import Model
from lagcli.output.figures import labels
from lagcli.output.tables.incident_table import IMPULSE
from lagcli.reporting import model_on_page
from lagcli.reporting.model_on_page import MOST_ROWS, Block, PageFigure, PageSection, PageSentences, PageTable
from lagcli.running.run_account import Stats
from lagcli.running.trajectory import Trajectory


@dataclasses.dataclass(frozen=True, slots=True)
class ReportParts:
    """The answers behind a report; equations: a page part, or the reason why there are none; still, curves, checks:
    the pictures, None where there are none; tolerance_text: the tolerance in words."""

    model: Model
    title: str
    checked: Report
    run: Trajectory
    audit: Audit
    equations: Block | str
    still: PageFigure | None
    curves: PageFigure | None
    checks: PageFigure | None
    tolerance_text: str


def contents(parts: ReportParts) -> model_on_page.ReportContents:
    """The page."""
    model, stopped, audit = parts.model, parts.run.stats.stopped, parts.audit
    failures, open_questions = [], []
    if stopped is not None:
        failures.append(f"The run stopped before its end, at t = {stopped.t:.9g}: {stopped.reason}.")
    if not audit.passed:
        failures.append(f"The audit failed: {audit.conclusion}")
    count = parts.checked.dof
    if count.configuration_dof is None:
        low, high = count.bounds
        open_questions.append(
            f"The number of degrees of freedom is undecided, between {low} and {high}: {count.reason}."
        )
    undecided = [one.name for one in parts.checked.constraints if one.verdict.kind == "undecided"]
    if undecided:
        open_questions.append(
            f"Undecided: whether {diagnostics.first_of(undecided, 'more')} can be integrated."
        )
    if audit.passed and any(check.verdict in ("not judged", "partly judged") for check in audit.checks):
        open_questions.append(f"Audit: {audit.conclusion}")
    equations: Block | str = parts.equations
    if isinstance(equations, str):
        equations = PageSentences((f"The equations are not written here: {equations}",))
    declared: tuple[Block, ...] = (
        *model_on_page.tables(model),
        model_on_page.listing(model.text, model.path),
    )
    sections = (
        PageSection("Model", "model", declared),
        PageSection("Degrees of freedom and verdicts", "verdicts", tuple(_verdicts(parts.checked))),
        PageSection("Equations of motion", "equations", (equations,)),
        PageSection("Motion", "motion", tuple(_motion(parts))),
        PageSection("Audit", "audit", tuple(_audit(parts.audit, parts.checks))),
        PageSection("Provenance", "provenance", tuple(_provenance(parts.run.stats, model))),
    )
    return model_on_page.ReportContents(
        labels.shortened(parts.title, labels.TITLE),
        tuple(filter(None, (model.description, f"Source: {model.source}" if model.source else ""))),
        tuple(failures),
        tuple(open_questions),
        tuple(_summary(parts)),
        sections,
    )


def _summary(parts: ReportParts) -> Iterator[tuple[str, str]]:
    count, run, stats = parts.checked.dof, parts.run, parts.run.stats
    time = parts.model.units.time
    if count.configuration_dof is not None:
        label = "3N - s" if count.coordinates == 3 * count.particles else "n - s"
        freedoms = f"{label} = {count.coordinates} - {count.holonomic} = {count.configuration_dof}"
        if count.nonholonomic:
            freedoms += f"; {count.velocity_dof} of velocity"
        yield "Degrees of freedom", f"{freedoms} (proof: {count.proof})"
    kinds = collections.Counter(one.verdict.kind for one in parts.checked.constraints)
    yield "Constraints", ", ".join(f"{number} {kind}" for kind, number in kinds.items()) or "none"
    if len(run.rows):
        end = f"t = {run.t[0]:.9g} to {run.t[-1]:.9g} {time}".rstrip()
        steps = f"{len(run.rows)} rows, {stats.steps} steps of {stats.method}"
        yield "Run", f"{end}, {steps}, {parts.tolerance_text}"
    if len(run.events):
        counts = collections.Counter(run.events.kinds)
        yield "Incidents", ", ".join(f"{number} × {kind}" for kind, number in counts.items())
    if stats.accuracy is not None and stats.accuracy.sentence:
        yield "Digits", _sentence(stats.accuracy.sentence)
    yield "Audit", parts.audit.conclusion


def _verdicts(checked: Report) -> Iterator[Block]:
    if checked.constraints:
        cells = [check_report.cells(one) for one in checked.constraints]
        shown = [name for name in cells[0] if any(row[name] for row in cells)]
        more = model_on_page.part(len(cells))
        rows = tuple(tuple(row[name] for name in shown) for row in cells[:MOST_ROWS])
        code = {i for i, name in enumerate(shown) if name in ("constraint", "integral", "factor")}
        yield PageTable(tuple(shown), rows, frozenset(code), f"Constraints and their verdicts{more}")
        verdicts = [one.verdict for one in checked.constraints]
        reasons = [f"{v.row}: {v.method}".rstrip(".") + "." for v in verdicts if v.declared != v.kind]
        if reasons:
            yield PageSentences(tuple(reasons[:MOST_ROWS]))
        if any(v.declared == "differential" for v in verdicts):
            yield PageSentences(tuple(map(_sentence, check_report.joint_lines(checked.joint))))
    lines = tuple((line,) for line in check_report.count(checked.dof))
    yield PageTable(("The count, line by line",), lines)
    if checked.null_vectors:
        yield PageSentences(tuple(independent_rows.shares([vector.rows for vector in checked.null_vectors])))
    yield PageSentences((_sentence(check_report.start(checked)),))
    warnings = tuple(f"Warning: {one.message} [{one.code}]." for one in checked.warnings)
    if warnings:
        yield PageSentences(warnings[:MOST_ROWS])


def _motion(parts: ReportParts) -> Iterator[Block]:
    run = parts.run
    yield from (figure for figure in (parts.still, parts.curves) if figure is not None)
    yield PageTable(("account of the run", ""), tuple(_account(run.stats)))
    if len(run.events):
        rows: list[tuple[str, ...]] = []
        for one in run.events[:MOST_ROWS]:
            impulse = one.impulses.get(one.name)
            rows.append((f"{one.t:.9g}", one.kind, one.name, f"{impulse:.6g}" if impulse else ""))
        more = model_on_page.part(len(run.events))
        time = f"t ({parts.model.units.time})" if parts.model.units.time.strip() else "t"
        headers: tuple[str, ...] = (time, "kind", "name", IMPULSE.rstrip("."))
        if not any(row[-1] for row in rows):
            headers, rows = headers[:-1], [row[:-1] for row in rows]
        yield PageTable(headers, tuple(rows), frozenset((2,)), f"Incidents{more}")
    if run.stats.warnings:
        yield PageSentences(tuple(f"Warning: {one.reason} [{one.code}]." for one in run.stats.warnings))
    if run.notes:
        yield PageSentences(tuple(f"Note: {note}." for note in run.notes))


def _account(stats: Stats) -> Iterator[tuple[str, str]]:
    yield "steps", f"{stats.steps} accepted, {stats.rejected} rejected, {stats.evaluations} evaluations"
    yield "largest drift of positions", f"{stats.position_drift:.1e}"
    yield "largest drift of velocities", f"{stats.velocity_drift:.1e}"
    off = stats.energy_imbalance
    yield "energy balance", "not known" if off is None else f"{off:.1e} of the energy exchanged"
    if stats.indeterminate:
        yield "multipliers not unique", diagnostics.first_of(stats.indeterminate, "more")
    if stats.singular_times:
        times = [f"t = {t:.9g}" for t in stats.singular_times]
        yield "singular configurations passed", diagnostics.first_of(times, "more")
    if stats.largest_penetration > 0:
        yield "largest penetration", f"{stats.largest_penetration:.1e}"
    if stats.ended_by is not None:
        yield "ended by the event", stats.ended_by
    if stats.stopped is not None:
        yield "stopped", f"t = {stats.stopped.t:.9g}: {stats.stopped.reason} [{stats.stopped.code}]"
    if stats.accuracy is not None:
        for kind, digits in stats.accuracy.digits.items():
            yield f"right digits of {kind}", "all zero" if digits is None else f"{digits:.1f}"


def _audit(found: Audit, figure: PageFigure | None) -> Iterator[Block]:
    yield PageSentences(
        (
            "A second opinion from the table and the model alone, without the functions of the solver:"
            f" {found.rows} rows from t = {found.start:.9g} to {found.end:.9g}. {found.conclusion}",
        )
    )
    lines = audit_report.lines(found)
    head, *rows = lines.rows
    failing = frozenset(i for i, check in enumerate(found.checks) if check.verdict == "fail")
    yield PageTable(head, tuple(rows), failures=failing)
    for failure, faults, more in lines.failures:
        yield PageSentences((failure, *faults, *((f"and {more} others",) if more else ())))
    *sentences, _ = lines.sentences  # the last one is the verdict, which stands above
    if sentences:
        yield PageSentences(tuple(map(_sentence, sentences)))
    if figure is not None:
        yield figure


def _provenance(stats: Stats, model: Model) -> Iterator[Block]:
    origin = stats.provenance
    assert origin is not None  # of a run that was made here
    chosen = model.simulation
    atol = "1e-13 of the sizes of the motion" if origin.atol is None else f"{origin.atol:.9g}"
    rows = [
        ("lagcli", origin.version),
        ("model file", model.path),
        ("SHA-256 of the model file", origin.sha256),
        *((f"--set {name}", value) for name, value in origin.set.items()),
        ("method", origin.method),
        ("rtol", f"{origin.rtol:.9g}"),
        ("atol", atol),
        ("start, duration", f"{chosen.start:.9g}, {chosen.duration:.9g}"),
        ("largest step", "free" if chosen.max_step is None else f"{chosen.max_step:.9g}"),
        ("units", ", ".join(unit for unit in dataclasses.astuple(model.units) if unit.strip())),
    ]
    yield PageTable(("", ""), tuple(rows))
    yield PageSentences(
        ("Equal files, settings and versions give this page again; it holds no date for that reason.",)
    )


def _sentence(text: str) -> str:
    plain = diagnostics.printable(text)
    return plain[:1].upper() + plain[1:] + ("" if plain.endswith((".", ":")) else ".")
