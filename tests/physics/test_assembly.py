"""`--assemble` and contradictions: the nearest consistent state from near and far, or the rows that cannot hold.

The truth is computed here, with gradients of our own; what is nearest is compared with searches by SciPy.
"""

import itertools
import re
import sys

import casadi as ca
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.optimize import least_squares

import lagcli
from lagcli import __main__ as entry
from lagcli.api import cache
from lagcli.linear.metric_rows import LocalRows
from lagcli.output.files import interrupts
from lagcli.start import assembly, conflict, initial, projection

ON = 1e-12


def document(places, laws, kind="holonomic", masses=None, velocities=None, more=""):
    """A model of particles p0, p1, ... and laws by name."""
    lines = ["lagcli: 1", "particles:"]
    for i, place in enumerate(places):
        mass = 1 if masses is None else masses[i]
        speed = "" if velocities is None else f", velocity: {[float(x) for x in velocities[i]]}"
        lines.append(f"  p{i}: {{mass: {float(mass)!r}, position: {[float(x) for x in place]}{speed}}}")
    lines.append(f"{kind}:")
    lines += [f"  {name}: {law}" for name, law in laws.items()]
    return "\n".join(lines) + "\n" + more


def assembled(text, keep=()):
    """Declared q (n,) and the assembly. Raises `lagcli.ModelError`."""
    ready = cache.compiled(lagcli.loads(text))
    state = initial.declared(ready.system)
    return state.q, assembly.assemble(ready.system, ready.numeric, state, keep)


def outcome(text, keep=()):
    """The assembly or None, and the errors in its place."""
    try:
        return assembled(text, keep)[1], ()
    except lagcli.ModelError as error:
        return None, error.diagnostics


def refused(question, text, **options):
    with pytest.raises(lagcli.ModelError) as caught:
        question(lagcli.loads(text), **options)
    return caught.value.diagnostics


class Frame:
    """Particles and rods (i, j) with lengths; gradients by hand."""

    def __init__(self, rods, lengths, masses):
        self.rods, self.lengths, self.masses = np.array(rods), np.array(lengths), np.array(masses, float)

    @property
    def laws(self):
        pairs = zip(self.rods, self.lengths, strict=True)
        return {f"r{k}": f"distance(p{i}, p{j}) = {float(s)!r}" for k, ((i, j), s) in enumerate(pairs)}

    @property
    def M(self):
        return np.repeat(self.masses, 3)

    def f(self, q):
        x = q.reshape(-1, 3)
        return np.linalg.norm(x[self.rods[:, 0]] - x[self.rods[:, 1]], axis=1) - self.lengths

    def B(self, q):
        x = q.reshape(-1, 3)
        rows = np.zeros((len(self.rods), len(x), 3))
        for row, (i, j) in zip(rows, self.rods, strict=True):
            row[i] = (x[i] - x[j]) / np.linalg.norm(x[i] - x[j])
            row[j] = -row[i]
        return rows.reshape(len(rows), -1)

    def nearest(self, q0, dice, tries):
        """The least distance, in the metric, of solutions found by penalties from random starts."""
        w, best = np.sqrt(self.M), np.inf
        for _ in range(tries):
            q = q0 + dice.choice([0.01, 0.3, 1.0, 2.0]) * dice.standard_normal(q0.size)
            for weight in (1.0, 1e2, 1e4, 1e6):

                def ways(z, weight=weight):
                    return np.concatenate([w * (z - q0), weight * self.f(z)])

                def slopes(z, weight=weight):
                    return np.vstack([np.diag(w), weight * self.B(z)])

                q = least_squares(ways, q, jac=slopes, xtol=1e-11, ftol=1e-11, gtol=1e-11, max_nfev=60).x
            if np.abs(self.f(q)).max() < 1e-4:
                best = min(best, float(np.linalg.norm(w * (q - q0))))
        return best


@st.composite
def frames(draw, most=5):
    """A frame that can be built (with more or fewer rods than make it stiff), and starts off it."""
    dice = np.random.default_rng(draw(st.integers(0, 2**20)))
    count = draw(st.integers(2, most))
    pairs = list(itertools.combinations(range(count), 2))
    number = draw(st.integers(1, len(pairs)))
    rods = [pairs[k] for k in sorted(dice.permutation(len(pairs))[:number])]
    places = dice.uniform(-1, 1, (count, 3))
    lengths = [np.linalg.norm(places[i] - places[j]) for i, j in rods]
    masses = dice.choice([0.25, 1.0, 4.0], count)
    off = draw(st.sampled_from([1e-6, 1e-3, 0.1, 0.5, 3.0]))
    start = places + off * dice.standard_normal(places.shape)
    return Frame(rods, lengths, masses), start, dice.standard_normal(places.shape)


def tangential(frame, q, step, free):
    """What is left of M step beside the gradients, on the free coordinates, as a part of it."""
    pushed, B = (frame.M * step)[free], frame.B(q)[:, free]
    left = pushed - B.T @ np.linalg.lstsq(B.T, pushed, rcond=1e-9)[0]
    return np.abs(left).max(initial=0.0) / max(np.abs(pushed).max(initial=0.0), 1e-300)


@given(frames(), st.sets(st.sampled_from(["p0", "p1.x", "p1.z", "p0.y"]), max_size=2))
@settings(max_examples=30)
def test_invariants_of_an_assembled_frame_or_a_named_error(sample, keep):
    frame, start, speeds = sample
    text = document(start, frame.laws, masses=frame.masses, velocities=speeds)
    names = [f"p{i}.{axis}" for i in range(len(start)) for axis in "xyz"]
    free = np.array([not (name in keep or name[:2] in keep) for name in names])
    found, errors = outcome(text, tuple(sorted(keep)))
    if found is None:
        assert keep, errors
        assert all("`r" in d.message and d.hint.startswith("let `keep` hold fewer") for d in errors)
        return
    q0 = start.ravel()
    q, v = found.state.q, found.state.v
    size = np.abs(q0).max()
    assert np.abs(frame.f(q)).max() <= ON * size
    assert np.abs(frame.B(q) @ v).max() <= ON * max(1.0, np.abs(v).max())
    assert (q[~free] == q0[~free]).all()
    assert (v[~free] == speeds.ravel()[~free]).all()
    moved = np.sqrt(frame.M @ (q - q0) ** 2)
    assert found.moved == pytest.approx(moved, rel=1e-9)
    # Of a way near rounding the direction is known to rounding only.
    assert tangential(frame, q, q - q0, free) <= 1e-9 + 1e-14 * size / max(np.abs(q - q0).max(), 1e-300)
    assert tangential(frame, q, v - speeds.ravel(), free) <= 1e-8


@given(frames(most=4), st.integers(0, 2**16))
@settings(max_examples=12)
def test_no_search_finds_a_nearer_configuration(sample, seed):
    frame, start, _ = sample
    q0, found = assembled(document(start, frame.laws, masses=frame.masses))
    assert found.moved <= frame.nearest(q0, np.random.default_rng(seed), 6) * 1.001 + 1e-5


@pytest.mark.parametrize(("length", "mass"), [(1e-6, 1e5), (1e6, 1.0), (1.0, 1e-5)])
def test_units_of_length_and_mass_do_not_count(length, mass):
    dice = np.random.default_rng(5)
    rods = list(itertools.combinations(range(4), 2))
    places, masses = dice.uniform(-1, 1, (4, 3)), np.array([1.0, 2.0, 0.5, 3.0])
    start = places + dice.standard_normal(places.shape)
    lengths = np.array([np.linalg.norm(places[i] - places[j]) for i, j in rods])
    _, plain = assembled(document(start, Frame(rods, lengths, masses).laws, masses=masses))
    frame = Frame(rods, lengths * length, masses * mass)
    _, found = assembled(document(start * length, frame.laws, masses=frame.masses))
    np.testing.assert_allclose(found.state.q / length, plain.state.q, rtol=0, atol=1e-9)


@pytest.mark.parametrize(
    ("law", "least"),
    [
        ("distance(p0, p1) = 2", np.sqrt(2)),
        ("dot(p0 - p1, p0 - p1) = 4", np.sqrt(2)),
        ("norm(p0 - p1) = 1e-7", 5e-8 * np.sqrt(2)),
    ],
)
@pytest.mark.parametrize("place", [(0, 0, 0), (3, 4, -5)])
def test_particles_at_one_point_are_moved_apart(law, least, place):
    """The gradient of the rod vanishes or has no value at the start; every direction is as near."""
    text = document([place, place], {"rod": law})
    (found,) = refused(lagcli.simulate, text)
    assert found.code == "inconsistent-start"
    assert "`rod`" in found.message
    _, done = assembled(text)
    assert done.moved == pytest.approx(least, rel=1e-6)
    assert lagcli.dof(lagcli.loads(text)).configuration_dof == 5


def chain(places, more=None):
    laws = {"r0": "distance(p0, [0, 0, 0]) = 1"}
    laws |= {f"r{i}": f"distance(p{i}, p{i - 1}) = 1" for i in range(1, len(places))}
    return document(places, laws | (more or {}))


def zigzag(count):
    steps = np.stack([np.full(count, 0.6), 0.8 * (-1.0) ** np.arange(count), np.zeros(count)], axis=1)
    return np.cumsum(steps, axis=0)


@pytest.mark.parametrize("start", ["stretched", "shaken"])
def test_a_chain_of_a_thousand_links_is_assembled(start):
    places = zigzag(1000)
    dice = np.random.default_rng(3)
    places = 1.5 * places if start == "stretched" else places + 0.3 * dice.standard_normal(places.shape)
    q = assembled(chain(places))[1].state.q.reshape(-1, 3)
    assert np.abs(np.linalg.norm(np.diff(q, axis=0, prepend=np.zeros((1, 3))), axis=1) - 1).max() <= 1e-10


def test_a_chain_is_pulled_straight_to_reach_its_far_end():
    _, found = assembled(chain(zigzag(60), {"end": "p59 = [55, 0, 0]"}))
    q = found.state.q.reshape(-1, 3)
    np.testing.assert_allclose(q[-1], [55, 0, 0], atol=1e-10)
    assert np.abs(np.linalg.norm(np.diff(q, axis=0, prepend=np.zeros((1, 3))), axis=1) - 1).max() <= 1e-11


def test_redundant_rows_do_not_change_the_assembly():
    places = zigzag(12)
    twins = {f"s{i}": f"3*dot(p{i} - p{i - 1}, p{i} - p{i - 1}) = 3" for i in range(1, 12)}
    _, independent = assembled(chain(1.5 * places))
    _, redundant = assembled(chain(1.5 * places, twins))
    np.testing.assert_allclose(redundant.state.q, independent.state.q, rtol=0, atol=1e-10)


def test_parts_that_share_nothing_are_each_the_nearest():
    """Each particle has a near and a far side of its ellipse, and no start finds the near one for all."""
    places = [(0.3 * (-1) ** i, 0.1, 0) for i in range(6)]
    laws = {f"o{i}": f"p{i}.x**2/4 + p{i}.y**2 = 1" for i in range(6)}
    laws |= {f"z{i}": f"p{i}.z = 0" for i in range(6)}
    _, found = assembled(document(places, laws))
    angle = np.linspace(0, 2 * np.pi, 200_001)
    nearest = np.hypot(0.3 - 2 * np.cos(angle), 0.1 - np.sin(angle)).min()
    assert found.moved == pytest.approx(np.sqrt(6) * nearest, rel=1e-8)


def test_differential_rows_take_part_in_the_velocities():
    text = document(
        [(0.2, 0.1, 0)],
        {"skate": "p0.x*rate(p0.y) - rate(p0.z) = 0.2"},
        "differential",
        velocities=[(1, 2, 3)],
    )
    q0, found = assembled(text, ("p0.z",))
    assert (found.state.q == q0).all()
    np.testing.assert_allclose(found.state.v, [1, 16, 3], rtol=1e-14)


# Rows that cannot hold.

SETS = {
    "two lengths of one rod": (
        [(1, 0, 0), (5, 0, 0)],
        {"one": "norm(p0) = 1", "free": "distance(p0, p1) = 4", "two": "norm(p0) = 1.2"},
        {"one", "two"},
        "contradictory-constraints",
    ),
    "one of them squared": (
        [(1, 0, 0)],
        {"one": "norm(p0) = 1", "flat": "p0.z = 0", "two": "dot(p0, p0) = 1.44"},
        {"one", "two"},
        "contradictory-constraints",
    ),
    "a sum": (
        [(1, 0, 0)],
        {"one": "p0.x = 1", "two": "p0.y = 2", "sum": "p0.x + p0.y = 4", "flat": "p0.z = 0"},
        {"one", "two", "sum"},
        "contradictory-constraints",
    ),
    "a triangle": (
        [(1, 0, 0), (2, 0, 0), (3, 1, 0)],
        {
            "ab": "distance(p0, p1) = 1",
            "bc": "distance(p1, p2) = 1",
            "flat": "p0.z = 0",
            "ca": "distance(p2, p0) = 3",
        },
        {"ab", "bc", "ca"},
        "no-consistent-start",
    ),
    "out of reach": (
        [(0, 0, 0.5), (1, 0, 0)],
        {"rod": "distance(p0, [0, 0, 2]) = 1", "more": "distance(p0, p1) = 1", "plane": "p0.z = 0"},
        {"rod", "plane"},
        "no-consistent-start",
    ),
    "a negative square": (
        [(1, 2, 3)],
        {"ok": "p0.z = 3", "never": "p0.x**2 + p0.y**2 = -1"},
        {"never"},
        "no-consistent-start",
    ),
}


@pytest.mark.parametrize("case", SETS)
def test_rows_that_cannot_hold_are_named_and_no_others(case):
    places, laws, named, code = SETS[case]
    text = document(places, laws)
    (found,) = refused(lagcli.dof, text)
    assert found.code == code
    assert set(re.findall(r"`(\w+)`", found.message)) == named
    told = refused(lagcli.simulate, text)  # the start is off the rows, and no other start would do
    assert code in {d.code for d in told}


@pytest.mark.parametrize("case", ["two lengths of one rod", "a negative square"])
def test_rows_that_cannot_hold_are_an_error_for_all_commands(case):
    places, laws, _, code = SETS[case]
    for question, options in ((lagcli.check, {}), (lagcli.simulate, {"assemble": True})):
        (found,) = refused(question, document(places, laws), **options)
        assert found.code == code


def test_each_conflict_is_reported():
    laws = {"a": "norm(p0) = 1", "b": "norm(p0) = 2", "c": "p1.x = 1", "d": "p1.x = 2", "e": "norm(p2) = 3"}
    found = refused(lagcli.dof, document(np.eye(3), laws))
    assert [set(re.findall(r"`(\w+)`", d.message)) for d in found] == [{"a", "b"}, {"c", "d"}]


def test_rows_beside_fixed_coordinates_are_counted_on_the_others(capfd):
    """Four rows on three coordinates of which one may not move: no more than two go to IPOPT, and nothing is told on
    the way to the answer, by CasADi or by NumPy."""
    text = """
lagcli: 1
particles: {a: {mass: 1, position: [1.2, 0.1, 0.3]}}
holonomic: {rod: norm(a) = 1, plane: a.y = 0, ramp: a.z = 0.5*a.x, hyperbola: a.x*a.z = 0.4}
"""
    with np.errstate(all="raise"):
        found = refused(lagcli.simulate, text, assemble=True, keep=("a.x",))
    assert {diagnostic.code for diagnostic in found} == {"no-consistent-start"}
    assert capfd.readouterr() == ("", "")


def test_what_keep_forbids_is_no_contradiction():
    laws = {"rod": "distance(p0, p1) = 1", "wall": "p1.x = 3"}
    (found,) = refused(
        lagcli.simulate, document([(0, 0, 0), (1, 0, 0)], laws), assemble=True, keep=("p0", "p1")
    )
    assert found.code == "no-consistent-start"
    assert "`wall`" in found.message
    assert "`rod`" not in found.message
    assert "`keep`" in found.hint
    text = document([(1, 0, 0)], {"go": "p0.x = 1 + t", "flat": "p0.z = 0"})
    (found,) = refused(lagcli.simulate, text, assemble=True, keep=("p0",))
    assert (found.code, "`go`" in found.message, "`flat`" in found.message) == (
        "no-consistent-start",
        True,
        False,
    )


GROWING = "distance(p0, [0, 0, 0]) = 1 + 0.1*t**{}"
PARTING = {
    "twin rods": (
        [(1, 0, 0)],
        {"one": "norm(p0) = 1", "up": "p0.z = 0", "two": GROWING.format(2)},
        {"one", "two"},
    ),
    "twins that part slowly": (
        [(1, 0, 0)],
        {"one": "norm(p0) = 1", "two": GROWING.format(4)},
        {"one", "two"},
    ),
    "one speed, two ways": (
        [(0, 0, 0)],
        {"one": "p0.x = 0*t", "up": "p0.y = 0", "two": "p0.x = t - sin(t)"},
        {"one", "two"},
    ),
    "opposite ways": (
        [(0, 0, 0)],
        {"up": "p0.z = 0", "one": "p0.x - t = 0", "two": "p0.x + t = 0"},
        {"one", "two"},
    ),
}


@pytest.mark.parametrize("case", PARTING)
def test_rows_that_part_later_are_refused_by_name(case):
    places, laws, named = PARTING[case]
    text = document(places, laws)
    for question, options in (
        (lagcli.check if case == "opposite ways" else lagcli.dof, {}),
        (lagcli.simulate, {"duration": 1}),
    ):
        (found,) = refused(question, text, **options)
        assert found.code == "contradictory-constraints"
        assert set(re.findall(r"`(\w+)`", found.message)) == named


def test_rows_that_move_alike_are_no_contradiction():
    laws = {"one": "norm(p0) = 1 + 0.1*t", "two": "dot(p0, p0) = (1 + 0.1*t)**2"}
    text = document([(1, 0, 0)], laws, velocities=[(0.1, 1, 0)])
    assert lagcli.dof(lagcli.loads(text)).configuration_dof == 2
    run = lagcli.simulate(lagcli.loads(text), duration=1, samples=3)
    assert run["p0.x"][-1] ** 2 + run["p0.y"][-1] ** 2 == pytest.approx(1.21, rel=1e-12)


def test_rounding_is_no_contradiction():
    laws = {"one": "p0.x = 0", "two": "p0.x + cos(3*t)**2 + sin(3*t)**2 = 1", "up": "p0.z = 0"}
    text = document([(0, 0, 0)], laws, velocities=[(0, 1, 0)])
    assert lagcli.dof(lagcli.loads(text)).configuration_dof == 1
    run = lagcli.simulate(lagcli.loads(text), duration=1, samples=3)
    assert run["p0.y"][-1] == pytest.approx(1, rel=1e-12)


@pytest.mark.parametrize("count", [5, 400])
def test_the_smallest_set_of_velocities_among_few_and_many(count):
    """A ring of differences that do not add up, among rows that say nothing about it."""
    B = np.zeros((count, count))
    for i in range(count):
        B[i, i], B[i, i - 1] = 1.0, -1.0 if i % (count // 5) == 0 or count == 5 else 0.0
    B = np.vstack([B, B[2] + B[3]])
    b = np.append(np.zeros(count), 0.5)
    found = conflict.least(LocalRows(lagcli_matrix(B)), b)
    assert found == [2, 3, count]


def lagcli_matrix(B):
    """Rows as the package holds them, sparse."""
    return ca.sparsify(ca.DM(B))


@pytest.mark.parametrize("twice", [False, True])
def test_a_start_off_the_circle_is_not_simulated_on_another(twice):
    laws = {"rod": "norm(p0) = 1"} | ({"twin": "dot(p0, p0) = 1"} if twice else {})
    text = document([(1.05, 0, 0)], laws)
    told = {d.message.partition("`")[2].partition("`")[0]: d for d in refused(lagcli.simulate, text)}
    assert set(told) == set(laws)
    assert {d.code for d in told.values()} == {"inconsistent-start"}
    assert "by 0.05 m" in told["rod"].message


# The command line.


@pytest.mark.parametrize(
    ("laws", "options", "code"),
    [
        ({"rod": "norm(p0) = 1"}, (), 1),
        ({"rod": "norm(p0) = 1"}, ("--assemble",), 0),
        ({"rod": "norm(p0) = 1", "other": "norm(p0) = 2"}, ("--assemble",), 1),
    ],
)
def test_exit_codes(tmp_path, capsys, monkeypatch, laws, options, code):
    path = tmp_path / "model.yaml"
    path.write_text(document([(1.5, 0, 0)], laws))
    arguments = ["lagcli", "simulate", str(path), "--duration", "0.1", "--samples", "3", *options]
    monkeypatch.setattr(sys, "argv", arguments)
    monkeypatch.setattr(interrupts, "install", lambda: None)  # pytest keeps its own
    with pytest.raises(SystemExit) as ended:
        entry.main()
    out, err = capsys.readouterr()
    assert ended.value.code == code
    if code == 0:
        assert re.search(r"^assembled: moved by 0\.5 ", err, re.MULTILINE)
        assert len(out.splitlines()) == 4
    else:
        assert out == ""
        assert "error[" in err


def test_a_minimum_that_several_searches_come_to_is_refined_once(monkeypatch):
    """Two rods held at both ends, from afar: the nearest configuration, its mirror image, and no more."""
    laws = {
        "a": "distance(p0, [0, 0, 0]) = 1", "b": "distance(p0, p1) = 1.2", "c": "distance(p1, [2, 0, 0]) = 1",
        "d": "p0.y = 0", "e": "p1.y = 0",
    }  # fmt: skip
    starts, nearest = [], projection.Surface.nearest

    def counted(self, q, *more):
        starts.append(q)
        return nearest(self, q, *more)

    monkeypatch.setattr(projection.Surface, "nearest", counted)
    _, found = assembled(document([[0.5, 0.3, -2], [1.7, -0.2, -1]], laws))
    assert found.moved > 1
    assert np.abs(found.state.q.reshape(2, 3) - [1, 0, 0]).max() < 2
    brief = starts[1:-1]
    assert 1 <= len(brief) <= 8
    apart = [float(np.abs(one - other).max()) for one, other in itertools.combinations(brief, 2)]
    assert min(apart, default=1.0) > 1e-7


OFF_THE_ROD = """lagcli: 1
particles: {b: {mass: 1, position: [0.01, 0, -0.99]}}
holonomic: {rod: norm(b) = 1, plane: b.y = 0}
forces: {weight: {to: b, force: [0, 0, -9.81*m]}}
simulation: {duration: 0.1, samples: 5}
"""


def test_answers_about_a_start_that_was_moved_say_so():
    model = lagcli.loads(OFF_THE_ROD)
    moved = lagcli.loads(OFF_THE_ROD.replace("0.99", "1.01").replace("samples", "assemble: true, samples"))
    answers = [
        lagcli.modes(model, assemble=True, about="equilibrium"),
        lagcli.compare(model, assemble=True),
        lagcli.compare(model, moved, assemble=True),
        lagcli.limit(model, "rod", stiffness="1e3", assemble=True),
    ]
    for answer in answers:
        assert any("assembled: moved by" in note for note in answer.notes)
        assert any("assembled: moved by" in note for note in answer.as_json()["notes"])
    unmoved = lagcli.loads(OFF_THE_ROD.replace("[0.01, 0, -0.99]", "[0, 0, -1]"))
    assert not any("moved" in note for note in lagcli.modes(unmoved, assemble=True).notes)
