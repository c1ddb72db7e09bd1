"""The law of impact, and the forces of contacts that stay closed, with all equality rows.

Impact: M (v+ - v-) = B^T Lambda_B + G^T Lambda, B v+ + b = 0, and for every contact
0 <= Lambda_j, dot g_j+ + e_j min(dot g_j-, 0) >= 0, one of the two zero (Newton's law as Moreau wrote it).
Forces: M a = h + B^T lambda_B + G^T lambda, B a = gamma_B, and 0 <= lambda_j, ddot g_j = (G a - gamma)_j >= 0.

Both ask for a push at one configuration. In the whitened metric (B~ = B M^-1/2) it is u = B~^T mu_B + G~^T mu_G: the
shortest with B~ u = c and G~ u >= d, where contacts only push and only where G~ u = d. Impacts ask it of velocities,
contact forces of accelerations.

Of few contacts whose rows stand well apart the answers are formulas: with D = G P G^T (k, k), P the inverse of M that
equality rows leave, 0 <= z, D z + c >= 0, one of the two zero for each contact. Every set that may push is tried; D is
positive definite, so that one answers (Cottle, Pang and Stone, The Linear Complementarity Problem, section 3.3).
"""

from __future__ import annotations

import dataclasses
import itertools

import numpy as np

from lagcli import doubles
from lagcli.arrays import Flags, Floats
from lagcli.contact import complementarity
from lagcli.contact.complementarity import ContradictoryRows, UndecidedRows
from lagcli.linear import rank
from lagcli.linear.metric import Metric
from lagcli.linear.metric_rows import LocalRows, MetricRows, Sparse, stacked


class ImpactParameters:
    """Impacts and forces of contacts. The tests are of `tests/unit/test_numbers_of_contacts.py` and
    `tests/unit/test_numbers_of_starts.py`."""

    __slots__ = ()

    most: int = 4
    """So many contacts are few (`test_four_contacts_are_few`)."""
    apart: float = 1e-2
    """A formula keeps its digits where the smallest eigenvalue of D with ones on its diagonal is not below this, and
    equality rows leave this part of the square of a row (`test_few_contacts_are_apart_from_a_hundredth`)."""


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

    unique: which of those are, (C + k,). slack: dot g+ or ddot g (k,). energy: 1/2 sum Lambda_j (dot g_j+ + dot g_j-),
    which is T+ - T- where rows are at rest; 0 for forces.
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
    rounding = complementarity.PARAMETERS.safe * doubles.EPS * terms
    wanted = -(rows.B.times(v) + b), least_after(before, e) - before
    change, of_equalities, impulses, unique = rows.push(*wanted, rounding)
    after = v + change
    speeds = rows.G.times(after) + g_t
    energy = certified(before, speeds, impulses, terms, metric.length(v) ** 2)
    return LawResult(after, of_equalities, impulses, unique, speeds, energy)


def certified(
    before: Floats, after: Floats, impulses: Floats, terms: Floats, at_hand: float | None = None
) -> float:
    """The energy gained by impulses of contacts (k,), none of which pulls. Raises `EnergyCreated`. before, after: dg/dt
    (k,); terms: the sizes of its terms before the impact; at_hand: twice the energy there is."""
    assert (impulses >= 0.0).all()
    gains = impulses * (before + after) / 2
    energy = float(gains.sum())
    through = float(impulses @ (terms + np.abs(after))) + (at_hand or 0.0)
    if energy > doubles.ZERO * through:
        raise EnergyCreated(tuple(int(row) for row in np.flatnonzero(gains > 0)), energy)
    return energy


def forces(
    metric: Metric, h: Floats, equalities: tuple[Sparse, Floats], contacts: tuple[Sparse, Floats]
) -> LawResult:
    """The accelerations and forces under h with rows B a = gamma, (B, gamma), and contacts G a >= gamma, (G, gamma).
    Raises `LawError` where no forces keep the contacts from closing."""
    (B, gamma_B), (G, gamma) = equalities, contacts
    rows, free = TouchingRows(metric, B, G), metric.solved(h)
    rounding = complementarity.PARAMETERS.safe * doubles.EPS * (_sizes(rows.G, free) + np.abs(gamma))
    wanted = gamma_B - rows.B.times(free), gamma - rows.G.times(free)
    change, of_equalities, of_contacts, unique = rows.push(*wanted, rounding)
    a = free + change
    slack = np.where(of_contacts > 0, 0.0, rows.G.times(a) - gamma)
    return LawResult(a, of_equalities, of_contacts, unique, slack)


def _sizes(G: LocalRows, x: Floats) -> Floats:
    """|G| |x| (k,)."""
    return np.asarray(np.bincount(G.row, np.abs(G.values * x[G.column]), minlength=G.count))


class TouchingRows:
    """Equality rows B (C, n) and contacts G (k, n) at one configuration, sparse; `metric` leaves no coordinate out.
    Blocks of rows that share no coordinate of the metric are solved alone, dense."""

    def __init__(self, metric: Metric, B: Sparse, G: Sparse) -> None:
        self.metric = metric
        self.B, self.G = LocalRows(B), LocalRows(G)
        rows = MetricRows(stacked(B, G), metric)
        self._lengths, self._unit = rows.lengths, LocalRows(rows.unit)

    def push(self, c: Floats, d: Floats, rounding: Floats) -> tuple[Floats, Floats, Floats, Flags]:
        """The change (n,) with B change = c (C,), G change >= d (k,) known to `rounding` (k,), and complementary; the
        impulses or forces (C,) and (k,) that make it, and which of them are unique (C + k,).

        Those that are not are split: the least sum of Lambda_i^2 |row_i M^-1/2|^2 over all rows together, contacts
        >= 0. Raises `LawError` with the contacts that cannot all be obeyed, or all where numbers do not decide.
        """
        C, lengths, unit = self.B.count, self._lengths, self._unit
        asked, rounding = np.concatenate([c, d]) / lengths, rounding / lengths[C:]
        if not (np.isfinite(asked).all() and np.isfinite(unit.values).all()):
            raise self._undecided("not finite")
        # Of a row alone this is the push.
        mu, unique = np.maximum(asked, 0.0), np.ones(asked.size, dtype=bool)
        mu[:C] = asked[:C]
        for rows, dense in unit.blocks():
            contacts = rows[rows >= C] - C
            block = ContactBlock(dense, rows.size - contacts.size)
            try:
                mu[rows], unique[rows] = block.push(asked[rows], rounding[contacts])
            except ContradictoryRows as error:
                own = tuple(int(contacts[row]) for row in error.rows)
                raise LawError("no push keeps all of these contacts from closing further", own) from None
            except UndecidedRows as error:
                raise self._undecided(str(error)) from None
        change = self.metric.unwhitened(unit.combined(mu))
        return change, mu[:C] / lengths[:C], mu[C:] / lengths[C:], unique

    def _undecided(self, reason: str) -> LawError:
        text = f"the law of impact does not decide ({reason}) for contacts"
        return LawError(text, tuple(range(self.G.count)))


class ContactBlock:
    """Rows of length one (C + k, m), dense, the equality rows first: a row of zeros holds nothing."""

    def __init__(self, unit: Floats, equalities: int) -> None:
        self._unit, self._count = unit, equalities
        self._equalities = rank.space(unit[:equalities], is_whole=False)

    def push(self, asked: Floats, rounding: Floats) -> tuple[Floats, Flags]:
        """The weights (C + k,) of the rows, as `TouchingRows.push`, and which are unique."""
        C, unit, contacts = self._count, self._unit, self._unit[self._count :]
        base, across = self._equalities.step(asked[:C]), self._equalities.basis
        # The contacts with the equality rows projected out; zero where nothing is left but rounding
        bare = contacts
        for _ in range(2):
            bare = bare - (bare @ across.T) @ across
        bare = np.where((np.linalg.norm(bare, axis=1) > rank.PARAMETERS.small)[:, None], bare, 0.0)
        found = complementarity.solve(bare, asked[C:] - contacts @ base, rounding)
        mu = np.concatenate([np.zeros(C), found.multipliers])
        mu[:C] = self._equalities.weights(base - across.T @ (across @ (contacts.T @ mu[C:])))
        rows = np.concatenate([np.ones(C, dtype=bool), found.holds])
        unique = np.ones(rows.size, dtype=bool)
        mu[rows], unique[rows] = complementarity.shared(unit[rows], mu[rows], C)
        # What the rows that hold are missing is asked for again; the second time it is rounding.
        held = np.flatnonzero((mu > 0) | (np.arange(mu.size) < C))
        holding = rank.space(unit[held], is_whole=False)
        for _ in range(2):
            mu[held] += holding.weights_of_step(asked[held] - unit[held] @ (unit.T @ mu))
        mu[C:] = np.maximum(mu[C:], 0.0)
        return mu, unique


@dataclasses.dataclass(frozen=True, slots=True, eq=False)
class Response:
    """The effect of an impulse 1 of a contact: velocities P G^T (n,), impulses of the equality rows (C,); square: G P
    G^T; free: G M^-1 G^T; left: the rounding of equality rows, as a part; terms: the sum of |G_i v_i| and |g_t|."""

    x: Floats
    of_equalities: Floats
    square: float
    free: float
    left: float
    terms: float

    @property
    def is_certain(self) -> bool:
        is_left = 0.0 < self.free < np.inf and self.square > PARAMETERS.apart * self.free
        return bool(is_left and self.left <= doubles.VALUE)


def single(v: Floats, speed: float, e: float, response: Response) -> LawResult | None:
    """The impact of one contact with dg/dt = speed and coefficient e; None where rounding is too large for a formula.
    Raises `EnergyCreated`."""
    if not response.is_certain:
        return None
    before = np.array([speed])
    asked = float(least_after(before, np.array([e]))[0])
    impulse = max(0.0, asked - speed) / response.square
    after = speed + impulse * response.square
    rounding = complementarity.PARAMETERS.safe * doubles.EPS * response.terms
    if not (after >= asked - rounding and (impulse == 0.0 or after <= asked + rounding)):
        return None
    speeds, impulses = np.array([after]), np.array([impulse])
    energy = certified(before, speeds, impulses, np.array([response.terms]))
    of_equalities = impulse * response.of_equalities
    unique = np.ones(of_equalities.size + 1, dtype=bool)
    return LawResult(v + impulse * response.x, of_equalities, impulses, unique, speeds, energy)


@dataclasses.dataclass(frozen=True, slots=True, eq=False)
class FewContacts:
    """The responses of contacts, and D."""

    responses: tuple[Response, ...]
    D: Floats

    @property
    def are_apart(self) -> bool:
        if not all(response.is_certain for response in self.responses):
            return False
        if len(self.responses) == 1:
            return True
        scale = 1 / np.sqrt(np.diag(self.D))
        return bool(np.linalg.eigvalsh(self.D * scale * scale[:, None])[0] >= PARAMETERS.apart)

    @property
    def free(self) -> Floats:
        """G_i M^-1 G_i^T (k,)."""
        return np.array([response.free for response in self.responses])

    def moved(self, x: Floats, z: Floats) -> Floats:
        for response, part in zip(self.responses, z.tolist(), strict=True):
            if part:
                x = x + part * response.x
        return x

    def of_equalities(self, z: Floats) -> Floats:
        """Impulses or forces of the equality rows (C,) beside those of the contacts, z (k,)."""
        return np.asarray(z @ np.array([response.of_equalities for response in self.responses]))

    def solve(self, c: Floats, rounding: Floats) -> Floats | None:
        """z (k,) with 0 <= z, D z + c >= -rounding and z_j = 0 or (D z + c)_j = 0; None where rounding decides."""
        count = c.size
        if (c >= -rounding).all():
            return np.zeros(count)
        for size in range(1, count + 1):
            for each in itertools.combinations(range(count), size):
                closed = list(each)
                if size == 1:
                    part = -c[closed] / self.D[closed[0], closed[0]]
                else:
                    part = np.linalg.solve(self.D[np.ix_(closed, closed)], -c[closed])
                if not (part > 0.0).all():
                    continue  # one that stays closed pulls
                z = np.zeros(count)
                z[closed] = part
                if (self.D @ z + c >= -rounding).all():
                    return z
        return None

    def impact(self, v: Floats, speeds: Floats, e: Floats, terms: Floats) -> LawResult | None:
        """The impact of contacts with dg/dt = speeds (k,), sums of terms (k,), and coefficients e (k,); None where
        rounding decides. Raises `EnergyCreated`."""
        c = speeds - least_after(speeds, e)
        z = self.solve(c, complementarity.PARAMETERS.safe * doubles.EPS * terms)
        if z is None:
            return None
        after = speeds + self.D @ z
        energy = certified(speeds, after, z, terms)
        of_equalities = self.of_equalities(z)
        unique = np.ones(of_equalities.size + z.size, dtype=bool)
        return LawResult(self.moved(v, z), of_equalities, z, unique, after, energy)
