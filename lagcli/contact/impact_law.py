"""The law of impact, and the forces of contacts that stay closed, with all equality rows.

Impact: M (v+ - v-) = B^T Lambda_B + G^T Lambda, B v+ + b = 0, and for every contact
0 <= Lambda_j, dot g_j+ + e_j min(dot g_j-, 0) >= 0, one of the two zero (Newton's law as Moreau wrote it).
Forces: M a = h + B^T lambda_B + G^T lambda, B a = gamma_B, and 0 <= lambda_j, ddot g_j = (G a - gamma)_j >= 0.
"""

from __future__ import annotations

import dataclasses

import numpy as np

from lagcli.contact.least_distance import ContradictoryRows, UndecidedRows
from lagcli.contact.load_sharing import Flags
from lagcli.contact.nonnegative import EPS, Floats
from lagcli.contact.single_contact import Response
from lagcli.contact.touching_rows import Push, TouchingRows
from lagcli.linear.metric import Metric
from lagcli.linear.metric_rows import Sparse

# Rounding of a sum, as many times that of its terms.
SAFE = 8.0
# The part of the energy at hand, and through contacts, which they may gain: speeds of gaps are no better known.
GAINED = 1e-9


class LawError(Exception):
    """Contacts, by their places among those given, for which the law has no answer."""

    def __init__(self, text: str, contacts: tuple[int, ...]) -> None:
        super().__init__(text)
        self.contacts = contacts


class EnergyCreated(LawError):
    """The law would make energy, `energy`; the contacts are those that open already and would be pushed."""

    def __init__(self, contacts: tuple[int, ...], energy: float) -> None:
        super().__init__(f"the law of impact would create energy, {energy:.3g}", contacts)
        self.energy = energy


@dataclasses.dataclass(frozen=True, slots=True, eq=False)
class LawResult:
    """x (n,), velocities after an impact or accelerations, and impulses or forces of the rows, (C,) and (k,).

    unique: which of those are, (C + k,), equality rows first. slack: of the contacts (k,), dot g+ or ddot g. energy:
    1/2 sum Lambda_j (dot g_j+ + dot g_j-), which is T+ - T- where rows are at rest; 0 for forces.
    """

    x: Floats
    of_equalities: Floats
    of_contacts: Floats
    unique: Flags
    slack: Floats
    energy: float = 0.0


def impact(
    metric: Metric, v: Floats, equalities: tuple[Sparse, Floats], contacts: tuple[Sparse, Floats, Floats]
) -> LawResult:
    """The impact of contacts G v + g_t with coefficients e, (G, g_t, e), held by rows B v + b = 0, (B, b).

    Raises `LawError` where no impulses part the contacts, `EnergyCreated` where they would make energy: with
    dot g_j- <= 0 at all contacts that cannot be, whatever their coefficients.
    """
    (B, b), (G, g_t, e) = equalities, contacts
    rows = TouchingRows(metric, B, G)
    before = rows.G @ v + g_t
    terms = np.abs(rows.G) @ np.abs(v) + np.abs(g_t)
    push = _push(rows, -(rows.B @ v + b), -e * np.minimum(before, 0.0) - before, SAFE * EPS * terms)
    after = v + push.change
    speeds = rows.G @ after + g_t
    energy = certified(Exchange(before, speeds, terms, metric.length(v) ** 2), push.contacts)
    return LawResult(after, push.equality, push.contacts, push.unique, speeds, energy)


def single(v: Floats, speed: float, e: float, response: Response) -> LawResult | None:
    """The impact of one contact with dg/dt = speed and coefficient e; None where rounding is too large for a formula.

    Raises `EnergyCreated`.
    """
    if not response.is_certain:
        return None
    asked = -e * min(speed, 0.0)
    impulse = max(0.0, asked - speed) / response.square
    after = speed + impulse * response.square
    rounding = SAFE * EPS * response.terms
    if not (after >= asked - rounding and (impulse == 0.0 or after <= asked + rounding)):
        return None
    before, speeds, impulses = np.array([speed]), np.array([after]), np.array([impulse])
    energy = certified(Exchange(before, speeds, np.array([response.terms])), impulses)
    of_equalities = impulse * response.of_equalities
    unique = np.ones(of_equalities.size + 1, dtype=bool)
    return LawResult(v + impulse * response.x, of_equalities, impulses, unique, speeds, energy)


@dataclasses.dataclass(frozen=True, slots=True, eq=False)
class Exchange:
    """dg/dt before and after an impact (k,), the sizes of their terms before it, and twice the energy at hand."""

    before: Floats
    after: Floats
    terms: Floats
    at_hand: float = 0.0


def certified(exchange: Exchange, impulses: Floats) -> float:
    """The energy gained by impulses of contacts (k,), none of which pulls. Raises `EnergyCreated`."""
    assert (impulses >= 0.0).all()
    gains = impulses * (exchange.before + exchange.after) / 2
    energy = float(gains.sum())
    through = float(impulses @ (exchange.terms + np.abs(exchange.after))) + exchange.at_hand
    if energy > GAINED * through:
        raise EnergyCreated(tuple(int(row) for row in np.flatnonzero(gains > 0)), energy)
    return energy


def forces(
    metric: Metric, h: Floats, equalities: tuple[Sparse, Floats], contacts: tuple[Sparse, Floats]
) -> LawResult:
    """The accelerations and forces under h with rows B a = gamma, (B, gamma), and contacts G a >= gamma, (G, gamma).

    Raises `LawError` where no forces keep the contacts from closing.
    """
    (B, gamma_B), (G, gamma) = equalities, contacts
    rows, free = TouchingRows(metric, B, G), metric.solved(h)
    rounding = SAFE * EPS * (np.abs(rows.G) @ np.abs(free) + np.abs(gamma))
    push = _push(rows, gamma_B - rows.B @ free, gamma - rows.G @ free, rounding)
    a = free + push.change
    slack = np.where(push.contacts > 0, 0.0, rows.G @ a - gamma)
    return LawResult(a, push.equality, push.contacts, push.unique, slack)


def _push(rows: TouchingRows, c: Floats, d: Floats, rounding: Floats) -> Push:
    try:
        return rows.push(c, d, rounding)
    except ContradictoryRows as error:
        raise LawError("no push keeps all of these contacts from closing further", error.rows) from None
    except UndecidedRows as error:
        everything = tuple(range(rows.count))
        raise LawError(f"the law of impact does not decide ({error}) for contacts", everything) from None
