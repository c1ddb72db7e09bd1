"""All checks of a record, in the order in which they are told."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from lagcli import model as nouns
from lagcli.auditing import momenta, motion, pointwise, principle, record, words
from lagcli.auditing.evidence import Evidence, Tolerance
from lagcli.auditing.laws import Laws, start
from lagcli.auditing.record import Record
from lagcli.auditing.report import Audit, Check, Law, judge
from lagcli.auditing.tape import Array

NUMBERS = Law("numbers", "", "every entry is a finite number")


def audit(
    model: nouns.Model, columns: Sequence[str], rows: Array, tolerance: Tolerance, notes: Sequence[str] = ()
) -> Audit:
    """The second opinion on a table, rows (T, len(columns)), of a model run to a tolerance.

    Raises `record.TableError` where columns are missing or times do not increase.
    """
    laws = Laws(model)
    found = record.read(laws, columns, rows)
    numbers = _numbers(laws, found)
    checks = [numbers]
    sentences: tuple[str, ...] = ()
    figures: tuple[tuple[str, float], ...] = ()
    if numbers.verdict != "fail":
        with np.errstate(all="ignore"):
            more, sentences, figures = _examined(Evidence(laws, found, tolerance))
        checks += more
    return Audit(
        title=model.title,
        path=model.path,
        rows=len(found.t),
        start=float(found.t[0]),
        end=float(found.t[-1]),
        rtol=tolerance.rtol,
        atol=tolerance.atol,
        checks=tuple(checks),
        sentences=sentences,
        notes=(*notes, *_elsewhere(model, found, tolerance)),
        figures=figures,
    )


def _examined(e: Evidence) -> tuple[list[Check], tuple[str, ...], tuple[tuple[str, float], ...]]:
    moved, found = motion.Motion(e), motion.energies(e)
    stretches = principle.windows(e)
    checks = [
        *pointwise.constraints(e),
        motion.rates(e),
        motion.path(e),
        moved.newton(),
        motion.impulse(e),
        *pointwise.reactions(e),
        *pointwise.demand(e),
        *pointwise.ideal(e),
        *pointwise.carried(e),
        moved.dalembert(),
        motion.energy(e, found),
        principle.hamilton(e, stretches),
        momenta.momenta(e),
    ]
    acted = principle.action(e, stretches)
    if acted is not None:
        checks.insert(-1, acted)
    rows, d = e.looked_at, e.displacements
    virtual = np.abs(d.virtual(e.record.R_q[rows]))[~d.is_singular]
    figures = (
        ("virtual_work", float(virtual.max(initial=0.0))),
        ("work_of_constraints", float(found.constraints[-1])),
        ("work_of_all_that_changes_the_energy", float(found.work.value[-1, 0])),
        ("energy_gained", float(found.E[-1] - found.E[0])),
    )
    return checks, words.sentences(e), figures


def _numbers(laws: Laws, found: Record) -> Check:
    """Entries that are no numbers; a multiplier may have none at a pole, which is judged with the others."""
    names = record.names(laws)
    parts = [(names.q, found.q), (names.v, found.v), (names.x, found.x), (names.u, found.u)]
    parts += [(names.R_q, found.R_q), (names.R_x, found.R_x)]
    columns = [name for part, _ in parts for name in part]
    entries = np.concatenate([values for _, values in parts], axis=1)
    infinite = np.isinf(found.lam)
    entries = np.concatenate([entries, np.where(infinite, np.nan, 0.0)], axis=1)
    residual = np.where(np.isfinite(entries), 0.0, np.nan)
    return judge(NUMBERS, [*columns, *names.lam], found.t, residual, np.ones((1, 1)))


def _elsewhere(model: nouns.Model, found: Record, tolerance: Tolerance) -> list[str]:
    """A table that begins at another place than the model says is that of another run, or of another model."""
    t, q, v = start(model)
    if found.t[0] != t or model.simulation.assemble:
        return []
    apart = np.abs(np.concatenate([found.q[0] - q, found.v[0] - v]))
    size = np.abs(np.concatenate([q, v])).max(initial=0.0)
    if not (apart > 1e3 * tolerance.rtol * size + 1e3 * tolerance.atol).any():
        return []
    names = (*model.coordinate_names, *(f"the rate of {name}" for name in model.coordinate_names))
    worst = int(np.argmax(apart))
    return [
        f"the table begins at another place than the model says ({names[worst]} is off by {apart[worst]:.3g}): it is of"
        " another start, or of another model"
    ]
