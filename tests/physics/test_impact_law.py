"""The law of impact and the forces of contacts, all rows together, against closed forms."""

import dataclasses

import casadi as ca
import numpy as np
import numpy.typing as npt
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import lagcli
from lagcli.contact import complementarity, impact_law
from lagcli.contact.impact_law import EnergyCreated, LawError, LawResult
from lagcli.linear.metric import Metric

Floats = npt.NDArray[np.float64]


@dataclasses.dataclass(frozen=True)
class Touching:
    """M, G and B at one configuration."""

    M: Floats
    G: Floats
    B: Floats

    @property
    def metric(self) -> Metric:
        return Metric(ca.sparsify(ca.DM(self.M)))

    def forces(self, h: Floats, gamma_B: Floats, gamma: Floats) -> LawResult:
        B, G = ca.sparsify(ca.DM(self.B)), ca.sparsify(ca.DM(self.G))
        return impact_law.forces(self.metric, h, (B, gamma_B), (G, gamma))


def touching(M: Floats, G: Floats, B: Floats | None = None) -> Touching:
    return Touching(M, G, np.zeros((0, len(M))) if B is None else B)


def impact(
    rows: Touching, v: Floats, e: float | Floats, b: Floats | None = None, g_t: npt.ArrayLike = 0.0
) -> LawResult:
    b = np.zeros(len(rows.B)) if b is None else b
    count = len(rows.G)
    B, G = ca.sparsify(ca.DM(rows.B)), ca.sparsify(ca.DM(rows.G))
    contacts = G, np.broadcast_to(np.asarray(g_t, dtype=float), count), np.broadcast_to(e, count)
    return impact_law.impact(rows.metric, v, (B, b), contacts)


def check(rows: Touching, v: Floats, b: Floats, found: LawResult) -> None:
    """Momentum and equality rows, to rounding; contacts push."""
    M, B, G = rows.M, rows.B, rows.G
    given_impulse = B.T @ found.of_equalities + G.T @ found.of_contacts
    size = np.abs(M) @ np.abs(v) + np.abs(B.T) @ np.abs(found.of_equalities) + np.abs(G.T) @ found.of_contacts
    assert np.abs(M @ (found.x - v) - given_impulse).max() <= 1e-11 * size.max()
    speed = np.abs(found.x).max() + np.abs(v).max()
    assert np.abs(B @ found.x + b).max(initial=0.0) <= 1e-11 * speed * (1 + np.abs(B).max(initial=0.0))
    assert (found.of_contacts >= 0).all()


def test_one_contact() -> None:
    """Lambda = -(1 + e) dot g / (G M^-1 G^T), with coupled coordinates and a wall that moves."""
    M = np.array([[2.0, 0.3, 0.0], [0.3, 1.0, 0.1], [0.0, 0.1, 3.0]])
    G, v, g_t = np.array([[1.0, -2.0, 0.5]]), np.array([-1.0, 0.7, 0.2]), -0.4
    rate = (G @ v)[0] + g_t
    found = impact(touching(M, G), v, 0.6, g_t=g_t)
    inverse = (G @ np.linalg.solve(M, G.T))[0, 0]
    assert found.of_contacts == pytest.approx([-1.6 * rate / inverse], rel=1e-14)
    assert found.slack == pytest.approx([-0.6 * rate], rel=1e-14)
    assert found.energy == pytest.approx(-0.5 * (1 - 0.36) * rate**2 / inverse, rel=1e-13)
    away = impact(touching(M, G), -v, 0.6, g_t=-g_t)
    assert away.of_contacts.tolist() == [0]
    assert (away.x == -v).all()


def test_touching_spheres_of_a_cradle() -> None:
    M = np.diag([0.3, 0.3, 0.3])
    G = np.array([[-1.0, 1, 0], [0, -1, 1]])
    found = impact(touching(M, G), np.array([2.0, 0, 0]), 1.0)
    assert found.x == pytest.approx(2 * np.array([-1, 2, 2]) / 3, abs=1e-15)
    assert found.of_contacts == pytest.approx([0.3 * 8 / 3, 0.3 * 4 / 3], rel=1e-14)
    assert found.energy == pytest.approx(0, abs=1e-14)


def test_into_the_edge_of_a_wedge() -> None:
    """v+ = -e v- whatever the angle; the impulses are those of the case `corner-acute`."""
    m, al, e, d, u = 1.2, 0.6, 0.5, 0.1, 1.5
    G = np.array([[np.cos(al), 0, np.sin(al)], [-np.cos(al), 0, np.sin(al)]])
    v = -u * np.array([np.sin(d), 0, np.cos(d)])
    found = impact(touching(np.diag([m, m, m]), G), v, e)
    assert found.x == pytest.approx(-e * v, abs=1e-14)
    assert found.of_contacts == pytest.approx(
        [2.542246299300934064882815, 2.215651614572667977316596], rel=1e-13
    )
    assert found.energy == pytest.approx(-1.0125, rel=1e-13)


def test_a_rod_transmits_a_blow() -> None:
    """A dumbbell hits a floor with one end: against (1 + e) and the mass felt through the rod."""
    m1, m2, L, ph, e = 1.0, 2.0, 0.8, -0.7, 0.6
    M = np.diag([m1, m1, m2, m2])
    along = np.array([np.cos(ph), np.sin(ph)])
    B = np.array([[*(-along), *along]]) * L
    G = np.array([[0.0, 0, 0, 1]])
    turn = np.array([-along[1], along[0]])
    v = np.concatenate([[0.3, -2.0], np.array([0.3, -2.0]) + 0.4 * L * turn])
    found = impact(touching(M, G, B), v, e)
    Minv = np.linalg.inv(M)
    P = Minv - Minv @ B.T @ np.linalg.inv(B @ Minv @ B.T) @ B @ Minv
    blow = -(1 + e) * v[3] / P[3, 3]
    assert found.of_contacts == pytest.approx([blow], rel=1e-13)
    assert found.x == pytest.approx(v + P @ G[0] * blow, abs=1e-14)
    check(touching(M, G, B), v, np.zeros(1), found)
    assert found.unique.all()


def test_a_sleigh_runs_into_a_wall() -> None:
    """The blade's row takes an impulse too: those of the case `sleigh-hits-wall`."""
    m, J, e, v0 = 1.3, 0.4, 0.7, 1.5
    th = 0.4 + 0.5 * 0.8155512352792051406090983
    v = np.array([v0 * np.cos(th), v0 * np.sin(th), 0.5])
    B, G = np.array([[np.sin(th), -np.cos(th), 0]]), np.array([[-1.0, 0, 0]])
    found = impact(touching(np.diag([m, m, J]), G, B), v, e)
    assert found.of_contacts == pytest.approx([4.796646653738086116474033], rel=1e-12)
    assert found.of_equalities == pytest.approx([3.466784406451716317914377], rel=1e-12)
    assert found.energy == pytest.approx(-0.745875, rel=1e-12)


def table(m: float = 2.0) -> tuple[Floats, Floats]:
    """A square table with four legs: coordinates fall, two tilts."""
    return np.diag([m, 0.5, 0.5]), np.array([[1.0, x, y] for x, y in ((1, 1), (-1, 1), (-1, -1), (1, -1))])


def test_a_table_falls_on_four_legs() -> None:
    M, G = table()
    found = impact(touching(M, G), np.array([-3.0, 0, 0]), 0.5)
    assert found.x == pytest.approx([1.5, 0, 0], abs=1e-14)
    assert found.of_contacts == pytest.approx([2 * 4.5 / 4] * 4, rel=1e-13)
    assert not found.unique.any()
    tilted = impact(touching(M, G), np.array([-3.0, 0.2, 0.1]), 0.5)
    check(touching(M, G), np.array([-3.0, 0.2, 0.1]), np.zeros(0), tilted)
    assert (tilted.slack + 0.5 * (G @ np.array([-3.0, 0.2, 0.1])) >= -1e-14).all()


def test_legs_share_with_what_holds_the_table() -> None:
    """A leg on which a rod stands as well: neither its push nor that of the rod is determined."""
    M, G = table()
    rows = touching(M, G[:1], G[:1])
    found = impact(rows, np.array([0.0, 0.3, -0.3]), 0.5)
    assert found.of_contacts.tolist() == [0]
    assert found.unique.tolist() == [False, False]
    with pytest.raises(LawError) as error:
        impact(touching(M, G[:2], G[:1]), np.array([-1.0, 0.0, 0.0]), 0.5, b=np.array([3.0]))
    assert error.value.contacts == (0,)


def test_forces_are_split_among_rods_and_contacts_alike() -> None:
    M, G = table()
    weight = np.array([-2 * 9.81, 0, 0])
    rows = touching(M, G[1:], G[:1])
    found = rows.forces(weight, np.zeros(1), np.zeros(3))
    assert found.x == pytest.approx([0, 0, 0], abs=1e-13)
    assert [*found.of_equalities, *found.of_contacts] == pytest.approx([9.81 / 2] * 4, rel=1e-13)
    assert not found.unique.any()
    # The rod pulls at one corner harder than the legs can share: they still only push.
    tipped = rows.forces(np.array([-1.0, -3.0, -3.0]), np.zeros(1), np.zeros(3))
    assert (tipped.of_contacts >= 0).all()
    assert M @ tipped.x == pytest.approx(
        np.array([-1.0, -3.0, -3.0]) + G[0] * tipped.of_equalities[0] + G[1:].T @ tipped.of_contacts,
        abs=1e-13,
    )


def test_forces_of_contacts_open_and_push() -> None:
    """A ball on a floor that sinks away and on one that comes up: ddot g = G a - gamma."""
    rows = touching(np.eye(1) * 3, np.ones((1, 1)))
    for gamma, force in ((-2.0, 3 * 7.81), (4.0, 3 * 13.81), (-9.81, 0.0), (-12.0, 0.0)):
        found = rows.forces(np.array([-3 * 9.81]), np.zeros(0), np.array([gamma]))
        assert found.of_contacts == pytest.approx([force], abs=1e-13)
        assert found.slack == pytest.approx([max(0.0, -9.81 - gamma)], abs=1e-13)
        assert found.x == pytest.approx([max(gamma, -9.81)], abs=1e-13)


def test_walls_that_move_do_work() -> None:
    """A bat at speed 2 meets a ball at speed 1: it leaves at 5; and rows of equality that move keep moving."""
    found = impact(touching(np.eye(1), np.ones((1, 1))), np.array([-1.0]), 1.0, g_t=-2.0)
    assert found.x == pytest.approx([5.0])
    assert found.energy == pytest.approx(0, abs=1e-14)
    M, B, G = np.eye(2), np.array([[1.0, 0.0]]), np.array([[1.0, 1.0]])
    found = impact(touching(M, G, B), np.array([2.0, -5.0]), 0.5, b=np.array([-2.0]))
    assert found.x == pytest.approx([2.0, -0.5])
    assert found.of_equalities == pytest.approx([-4.5])


def test_two_pistons_that_close_are_refused() -> None:
    rows = touching(np.eye(2), np.array([[0.0, 1], [1, 0], [-1, 0]]))
    with pytest.raises(LawError) as error:
        impact(rows, np.array([0.0, 0.0]), 0.5, g_t=[0, -1, -1])
    assert error.value.contacts == (1, 2)
    with pytest.raises(LawError):
        impact(rows, np.array([np.nan, 0.0]), 0.5)


def test_energy_is_not_created() -> None:
    """A contact that opens already is pushed against by a blow at e = 1 in an acute wedge: the law would stop it, and
    all of the speed that is lost there is gained elsewhere."""
    G = np.array([[1.0, 0.0], [-0.8, 0.6]])
    v = np.array([-1.0, -0.8])
    assert (G @ v)[1] > 0
    with pytest.raises(EnergyCreated) as error:
        impact(touching(np.eye(2), G), v, 1.0)
    assert error.value.contacts == (1,)
    assert error.value.energy > 0
    lossy = impact(touching(np.eye(2), G), v, np.array([0.2, 1.0]))
    assert lossy.energy < 0


def test_many_particles_and_one_blow() -> None:
    """Only rows are dense: a thousand particles in space, three of which touch."""
    n, random = 3000, np.random.default_rng(0)
    M = ca.DM(ca.Sparsity.diag(n), ca.DM(1 + random.random(n)))
    G = ca.DM(3, n)
    for j in range(3):
        G[j, j], G[j, j + 1] = -1, 1
    v = random.standard_normal(n)
    v[:4] = [3, 2, 1, 0]
    equalities = ca.DM(0, n), np.zeros(0)
    found = impact_law.impact(Metric(M), v, equalities, (G, np.zeros(3), np.zeros(3)))
    masses = np.array(M.nonzeros())[:4]
    assert found.x[:4] == pytest.approx(np.full(4, masses @ v[:4] / masses.sum()), rel=1e-14)
    assert (found.x[4:] == v[4:]).all()


@given(st.integers(0, 10**7), st.integers(1, 6), st.integers(0, 3), st.integers(1, 6), st.booleans())
@settings(max_examples=150, deadline=None)
def test_random_impacts(seed: int, n: int, held: int, count: int, is_whole: bool) -> None:
    """Whatever touches: momentum, rows and the law hold, and no coefficients make energy where all contacts close."""
    random = np.random.default_rng(seed)

    def draw(*shape: int) -> Floats:
        drawn = random.integers(-1, 2, shape) if is_whole else random.standard_normal(shape)
        return np.asarray(drawn, dtype=float)

    root = random.standard_normal((n, n))
    M = root @ root.T + 0.1 * np.eye(n)
    B, v, G, e = draw(held, n), random.standard_normal(n), draw(count, n), random.random(count)
    b = -B @ v
    # Contacts that would open are turned round.
    G = np.where((G @ v)[:, None] > 0, -G, G)
    rows = touching(M, G, B)
    try:
        found = impact(rows, v, e, b=b)
    except LawError:
        # Some are opposite, or the equality rows leave no room.
        return
    check(rows, v, b, found)
    law = found.slack + e * np.minimum((G @ v), 0)
    speed = 1 + np.abs(found.x).max()
    assert (law >= -1e-9 * speed).all()
    assert np.abs(law[found.of_contacts > 1e-9 * speed]).max(initial=0.0) <= 1e-9 * speed
    assert found.energy <= 1e-12
    kinetic = (found.x @ M @ found.x - v @ M @ v) / 2
    work = found.energy - found.of_equalities @ b
    assert kinetic == pytest.approx(work, abs=1e-9 * (1 + v @ M @ v + np.abs(found.of_equalities @ b)))


CLOSING = """
lagcli: 1
particles:
  a: {mass: 1, position: [0.5, 0, 0], velocity: [0.4, 0, 0]}
inequality:
  ceiling: {condition: a.z <= 5, restitution: 1}
  left: {condition: a.x >= t, restitution: 0.5}
  right: {condition: a.x <= 2 - t, restitution: 0.5}
"""


def test_a_run_between_walls_that_close_names_them() -> None:
    """Of three contacts only those that touch are put to the law: their names are told, not those of their places."""
    with pytest.raises(lagcli.SimulationStopped, match=r"closing further: `left`, `right`"):
        lagcli.simulate(lagcli.loads(CLOSING), duration=2, samples=2)


def test_momenta_that_are_not_linear_in_the_velocities_have_no_impact() -> None:
    text = """
lagcli: 1
coordinates: {x: {value: 1, rate: -1}, y: {rate: -1}}
lagrangian: rate(x)**2/2 + LAW
inequality: {floor: {condition: x >= 0, restitution: 0.5}}
simulation: {duration: 3}
"""
    with pytest.raises(
        lagcli.SimulationStopped, match=r"momenta are not linear in the velocities.*`floor`"
    ) as stop:
        lagcli.simulate(lagcli.loads(text.replace("LAW", "rate(x)**4/12 + rate(y)**2/2")))
    assert stop.value.t == pytest.approx(1, abs=1e-9)
    run = lagcli.simulate(lagcli.loads(text.replace("LAW", "(2 + cos(x))*rate(y)**2/2")))
    assert run.stats.impacts == 1


def separate_and_joined(seed: int) -> tuple[Touching, list[list[int]]]:
    """Three bodies that share no coordinate, the first with an equality row and the second with a coupled M, in an
    order of their own; and the contacts of each."""
    rng = np.random.default_rng(seed)
    M, G, B = np.eye(9), np.zeros((7, 9)), np.zeros((1, 9))
    M[3:6, 3:6] += 0.5 * np.ones((3, 3))
    B[0, :3] = rng.standard_normal(3)
    bodies = [[0, 3], [1, 4, 6], [2, 5]]
    for first, contacts in zip((0, 3, 6), bodies, strict=True):
        # Coordinates of the first two are coupled by B and M: each contact may touch one of them alone.
        for number, j in enumerate(contacts):
            G[j, first + number] = rng.uniform(0.5, 2.0)
    G[5, 6] = rng.uniform(0.5, 2.0)
    order = rng.permutation(9)
    return touching(M[np.ix_(order, order)], G[:, order], B[:, order]), bodies


@pytest.mark.parametrize("seed", range(8))
def test_contacts_of_bodies_that_do_not_touch_are_solved_apart_and_as_if_together(monkeypatch, seed):
    rows, bodies = separate_and_joined(seed)
    rng = np.random.default_rng(seed)
    # All contacts approach; the one coordinate of the equality row that none touches meets it.
    v, e = -rng.uniform(0.5, 1.5, 9), rng.uniform(0.0, 1.0, 7)
    free = np.flatnonzero((rows.B[0] != 0) & (np.abs(rows.G).sum(axis=0) == 0))[0]
    v[free] -= rows.B[0] @ v / rows.B[0, free]
    solve, sizes = complementarity.solve, []

    def counted(*args):
        sizes.append(args[1].size)
        return solve(*args)

    monkeypatch.setattr(complementarity, "solve", counted)
    found = impact(rows, v, e)
    assert sorted(sizes) == sorted(len(contacts) for contacts in bodies)
    check(rows, v, np.zeros(1), found)
    # The whole law by its own conditions, and by one dense problem of all rows.
    white = np.vstack([rows.B, rows.G]) @ np.linalg.inv(np.linalg.cholesky(rows.M)).T
    lengths = np.linalg.norm(white, axis=1)
    before = rows.G @ v
    asked = np.concatenate([np.zeros(1), -e * np.minimum(before, 0.0) - before]) / lengths
    mu, unique = impact_law.ContactBlock(white / lengths[:, None], 1).push(asked, np.zeros(7))
    impulses = np.concatenate([found.of_equalities, found.of_contacts])
    assert impulses == pytest.approx(mu / lengths, rel=1e-12, abs=1e-12)
    assert (found.unique == unique).all()
    rest = found.slack + e * np.minimum(before, 0.0)
    assert (rest >= -1e-12).all()
    assert found.of_contacts * rest == pytest.approx(0.0, abs=1e-12)


def test_contacts_alone_on_their_bodies_ask_for_no_problem_at_all(monkeypatch):
    monkeypatch.setattr(complementarity, "solve", None)
    mass, v = np.array([1.0, 2.0, 3.0, 4.0, 5.0, 6.0]), np.array([-1.0, 2.0, 0.0, -3.0, -0.5, 1.0])
    rows = touching(np.diag(mass), np.eye(6))
    found = impact(rows, v, 0.5)
    closing = np.minimum(v, 0.0)
    assert found.x == pytest.approx(np.where(v < 0, -0.5 * v, v), rel=1e-15)
    assert found.of_contacts == pytest.approx(-1.5 * mass * closing, rel=1e-15)
    assert found.unique.all()
    assert found.energy == pytest.approx(-0.375 * float(mass @ closing**2), rel=1e-14)
    forces = rows.forces(-9.81 * mass, np.zeros(0), np.zeros(6))
    assert forces.of_contacts == pytest.approx(9.81 * mass, rel=1e-15)
    assert forces.x == pytest.approx(0.0, abs=1e-14)


def test_contacts_that_contradict_each_other_are_named_among_all():
    # On the third coordinate two contacts close in on a body from both sides; the others are free.
    G = np.array([[1.0, 0.0, 0.0], [0.0, 0.0, 1.0], [0.0, 1.0, 0.0], [0.0, 0.0, -1.0]])
    with pytest.raises(LawError) as error:
        impact(touching(np.eye(3), G), np.zeros(3), 0.0, g_t=np.array([0.0, -1.0, 0.0, -1.0]))
    assert error.value.contacts == (1, 3)


def test_a_contact_without_a_gradient_holds_nothing_and_one_that_has_to_is_named():
    G = np.array([[1.0, 0.0], [0.0, 0.0]])
    found = impact(touching(np.eye(2), G), np.array([-1.0, 0.0]), 0.0)
    assert found.of_contacts.tolist() == [1.0, 0.0]
    assert found.unique.tolist() == [True, False]
    with pytest.raises(LawError) as error:
        impact(touching(np.eye(2), G), np.array([-1.0, 0.0]), 0.0, g_t=np.array([0.0, -1.0]))
    assert error.value.contacts == (1,)
