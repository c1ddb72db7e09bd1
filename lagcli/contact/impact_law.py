"""The law of impact, and the forces of contacts that stay closed, with all equality rows.

Impact: M (v+ - v-) = B^T Lambda_B + G^T Lambda, B v+ + b = 0, and for every contact
0 <= Lambda_j, dot g_j+ + e_j min(dot g_j-, 0) >= 0, one of the two zero (Newton's law as Moreau wrote it).
Forces: M a = h + B^T lambda_B + G^T lambda, B a = gamma_B, and 0 <= lambda_j, ddot g_j = (G a - gamma)_j >= 0.

Both ask for a push at one configuration. In the whitened metric (B~ = B M^-1/2) it is u = B~^T mu_B + G~^T mu_G: the
shortest with B~ u = c and G~ u >= d, where contacts only push and only where G~ u = d. Impacts ask it of velocities,
contact forces of accelerations.
"""

from __future__ import annotations

import dataclasses

import numpy as np

from lagcli import doubles
from lagcli.contact import complementarity, load_sharing
from lagcli.contact.least_distance import ContradictoryRows, Floats, UndecidedRows
from lagcli.contact.load_sharing import Flags
from lagcli.linear import rank
from lagcli.linear.metric import Metric
from lagcli.linear.metric_rows import LocalRows, MetricRows, Sparse, stacked


class ImpactParameters:
    """Impacts and forces of contacts; parts are of no unit.

    The tests are of `tests/unit/test_numbers_of_contacts.py`.
    """

    __slots__ = ()

    refinements: int = 2
    """Each refinement gains all the digits there are; the second finds nothing but rounding.
    `test_rows_of_an_impact_are_met_to_rounding_after_two_refinements` fails at 0."""


PARAMETERS = ImpactParameters()


class LawError(Exception):
    """Contacts, by their indices among those given, for which the law has no answer."""

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


def least_after(before: Floats, e: Floats) -> Floats:
    """The least dg/dt (k,) after an impact that is met with rates `before` (k,), by Newton's law: another law of impact
    is another function here."""
    return np.asarray(-e * np.minimum(before, 0.0))


def impact(
    metric: Metric, v: Floats, equalities: tuple[Sparse, Floats], contacts: tuple[Sparse, Floats, Floats]
) -> LawResult:
    """The impact of contacts G v + g_t with coefficients e, (G, g_t, e), under rows B v + b = 0, (B, b).

    Raises `LawError` where no impulses part the contacts, `EnergyCreated` where they would make energy: with
    dot g_j- <= 0 at all contacts that cannot be, whatever their coefficients.
    """
    (B, b), (G, g_t, e) = equalities, contacts
    rows = TouchingRows(metric, B, G)
    before = rows.G.times(v) + g_t
    terms = _sizes(rows.G, v) + np.abs(g_t)
    push = _push(
        rows,
        -(rows.B.times(v) + b),
        least_after(before, e) - before,
        complementarity.PARAMETERS.safe * doubles.EPS * terms,
    )
    after = v + push.change
    speeds = rows.G.times(after) + g_t
    energy = certified(Exchange(before, speeds, terms, metric.length(v) ** 2), push.contacts)
    return LawResult(after, push.equality, push.contacts, push.unique, speeds, energy)


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
    if energy > doubles.ZERO * through:
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
    rounding = complementarity.PARAMETERS.safe * doubles.EPS * (_sizes(rows.G, free) + np.abs(gamma))
    push = _push(rows, gamma_B - rows.B.times(free), gamma - rows.G.times(free), rounding)
    a = free + push.change
    slack = np.where(push.contacts > 0, 0.0, rows.G.times(a) - gamma)
    return LawResult(a, push.equality, push.contacts, push.unique, slack)


def _sizes(G: LocalRows, x: Floats) -> Floats:
    """|G| |x| (k,)."""
    return np.asarray(np.bincount(G.row, np.abs(G.values * x[G.column]), minlength=G.count))


def _push(rows: TouchingRows, c: Floats, d: Floats, rounding: Floats) -> Push:
    try:
        return rows.push(c, d, rounding)
    except ContradictoryRows as error:
        raise LawError("no push keeps all of these contacts from closing further", error.rows) from None
    except UndecidedRows as error:
        everything = tuple(range(rows.count))
        raise LawError(f"the law of impact does not decide ({error}) for contacts", everything) from None


@dataclasses.dataclass(frozen=True, slots=True, eq=False)
class Push:
    """change: M^-1 (B^T equality + G^T contacts) (n,). equality (C,), contacts (k,) >= 0; unique (C + k,)."""

    change: Floats
    equality: Floats
    contacts: Floats
    unique: Flags


class TouchingRows:
    """Equality rows B (C, n) and contacts G (k, n) at one configuration, sparse; `metric` leaves no coordinate out.

    Nothing of size n x n is built. Rows that have no coordinate of the metric in common, and none with others between
    them, do not act on each other: each such block is solved alone, dense.
    """

    def __init__(self, metric: Metric, B: Sparse, G: Sparse) -> None:
        self.metric = metric
        self.B, self.G = LocalRows(B), LocalRows(G)
        rows = MetricRows(stacked(B, G), metric)
        self._lengths, self._unit = rows.lengths, LocalRows(rows.unit)

    @property
    def equalities(self) -> int:
        """Equality rows, C."""
        return self.B.count

    @property
    def count(self) -> int:
        """Contacts, k."""
        return self.G.count

    def push(self, c: Floats, d: Floats, rounding: Floats) -> Push:
        """The push with B change = c (C,), G change >= d (k,) known to `rounding` (k,), and complementary.

        Impulses or forces that are not unique are split: the least sum of Lambda_i^2 |row_i M^-1/2|^2 over all rows
        together, contacts >= 0. Raises `ContradictoryRows` with the contacts that cannot all be obeyed, and
        `UndecidedRows`.
        """
        C, lengths, unit = self.equalities, self._lengths, self._unit
        asked, rounding = np.concatenate([c, d]) / lengths, rounding / lengths[C:]
        if not (np.isfinite(asked).all() and np.isfinite(unit.values).all()):
            raise UndecidedRows("not finite")
        # Of a row alone this is the push.
        mu, unique = np.maximum(asked, 0.0), np.ones(asked.size, dtype=bool)
        mu[:C] = asked[:C]
        for rows, dense in unit.blocks():
            contacts = rows[rows >= C] - C
            block = ContactBlock(dense, rows.size - contacts.size)
            try:
                mu[rows], unique[rows] = block.push(asked[rows], rounding[contacts])
            except ContradictoryRows as error:
                raise ContradictoryRows(tuple(int(contacts[row]) for row in error.rows)) from None
        change = self.metric.unwhitened(unit.combined(mu))
        return Push(change, mu[:C] / lengths[:C], mu[C:] / lengths[C:], unique)


class ContactBlock:
    """Rows of length one (C + k, m), dense, the equality rows first: a row of zeros holds nothing."""

    def __init__(self, unit: Floats, equalities: int) -> None:
        self._unit, self._count = unit, equalities
        self._equalities = rank.space(unit[:equalities], is_whole=False)

    def push(self, asked: Floats, rounding: Floats) -> tuple[Floats, Flags]:
        """The weights (C + k,) of the rows, as `TouchingRows.push`, and which are unique."""
        C, contacts = self._count, self._unit[self._count :]
        base, across = self._equalities.step(asked[:C]), self._equalities.basis
        bare = self._bare(contacts)
        found = complementarity.solve(bare, asked[C:] - contacts @ base, rounding)
        mu = np.concatenate([np.zeros(C), found.multipliers])
        mu[:C] = self._equalities.weights(base - across.T @ (across @ (contacts.T @ mu[C:])))
        rows = np.concatenate([np.ones(C, dtype=bool), found.holds])
        unique = np.ones(rows.size, dtype=bool)
        mu[rows], unique[rows] = load_sharing.shared(self._unit[rows], mu[rows], C)
        return self._refined(mu, asked), unique

    def _bare(self, contacts: Floats) -> Floats:
        """The contacts (k, n) with the equality rows projected out; zero where nothing is left but rounding."""
        bare, across = contacts, self._equalities.basis
        for _ in range(2):
            bare = bare - (bare @ across.T) @ across
        lengths = np.linalg.norm(bare, axis=1)
        return np.where((lengths > rank.PARAMETERS.small)[:, None], bare, 0.0)

    def _refined(self, mu: Floats, asked: Floats) -> Floats:
        """mu with the rows that hold met to rounding: what they are missing is asked for again."""
        rows = np.flatnonzero((mu > 0) | (np.arange(mu.size) < self._count))
        holding, mu = rank.space(self._unit[rows], is_whole=False), mu.copy()
        for _ in range(PARAMETERS.refinements):
            missing = asked[rows] - self._unit[rows] @ (self._unit.T @ mu)
            mu[rows] += holding.weights_of_step(missing)
        mu[self._count :] = np.maximum(mu[self._count :], 0.0)
        return mu
