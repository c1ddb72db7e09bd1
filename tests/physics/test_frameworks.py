"""Random frameworks of particles and rods, with rows that follow from others: counts, names and multipliers.

The truth is exact: ranks and null vectors of rational rows by elimination (`exact_rank`). Rows may be written by
lengths, by squared lengths or scaled, for the gradient only changes its length; combinations are of squares, so that
their weights stay rational.
"""

from __future__ import annotations

import dataclasses
import functools
import itertools
import pathlib
import re
from fractions import Fraction

import numpy as np
import pytest
import scipy.integrate
import scipy.optimize
from hypothesis import assume, given, settings
from hypothesis import strategies as st

import lagcli
from tests.helpers import exact_rank

pytestmark = pytest.mark.numeric

NAMES = "abcdefgh"
MASSES = (0.25, 1.0, 1.5, 4.0)
GRAVITY = np.array([0.0, 0.0, -9.81])
SAME, ON = 1e-9, 1e-10


def indeterminate(run):
    """Names of the rows whose multiplier is not unique, from the account of a run."""
    return set(run.stats.indeterminate)


def not_unique(report):
    """The same from `check`."""
    return {row["name"] for row in report.as_json()["constraints"] if not row["unique"]}


def redundant(report):
    """Names of the rows that follow from rows before them."""
    return {row["name"] for row in report.as_json()["constraints"] if row["redundant"]}


# Laws: each a text, an exact row, and its gradient in numbers at any place.


@dataclasses.dataclass(frozen=True)
class Law:
    """One equation: weights on the base rods, each in its way of writing."""

    rods: tuple[int, ...]
    weights: tuple[Fraction, ...]
    form: str  # distance, root, square, scaled, combination

    def exact(self, base):
        return [
            sum(w * base[i][k] for i, w in zip(self.rods, self.weights, strict=True))
            for k in range(len(base[0]))
        ]


@dataclasses.dataclass(frozen=True)
class Framework:
    """Points (rational), their masses, and rods: pairs, or a point and a fixed place."""

    points: tuple[tuple[Fraction, ...], ...]
    masses: tuple[float, ...]
    rods: tuple[exact_rank.Rod, ...]
    laws: tuple[Law, ...]

    @property
    def base(self):
        return exact_rank.rigidity(self.points, self.rods)

    @property
    def matrix(self):
        base = self.base
        return [law.exact(base) for law in self.laws]

    @property
    def names(self):
        return [f"row{k}" for k in range(len(self.laws))]

    @property
    def is_regular(self):
        """Whether the rods have the highest rank that points can have (the anchors stay)."""
        return exact_rank.rank(self.base) == exact_rank.generic_rank(len(self.points), 3, self.rods)

    def end(self, i):
        other = self.rods[i][1]
        return NAMES[other] if isinstance(other, int) else "[" + ", ".join(str(float(x)) for x in other) + "]"

    def square(self, i):
        """(text of the squared length, its value)."""
        a, other = self.rods[i]
        far = self.points[other] if isinstance(other, int) else other
        apart = f"{NAMES[a]} - {self.end(i)}"
        value = sum((x - y) ** 2 for x, y in zip(self.points[a], far, strict=True))
        return f"dot({apart}, {apart})", value

    def text_of(self, law, off=Fraction(0)):
        """The equation, of a squared length that is `off` too large."""
        if law.form == "combination":
            parts = []
            for i, weight in zip(law.rods, law.weights, strict=True):
                text, value = self.square(i)
                parts.append(f"({float(weight)})*({text} - {float(value)})")
            return " + ".join(parts) + f" = {float(off)}"
        (i,) = law.rods
        text, value = self.square(i)
        a = NAMES[self.rods[i][0]]
        length = f"sqrt({float(value + off)})"
        factor = float(law.weights[0])
        return {
            "distance": f"distance({a}, {self.end(i)}) = {length}",
            "root": f"{length} = norm({a} - {self.end(i)})",
            "square": f"distance({a}, {self.end(i)})**2 = {float(value + off)}",
            "scaled": f"{factor}*({text} - {float(value + off)}) = 0",
        }[law.form]

    def gradients(self, places):
        """B at places (T, N, 3), shape (T, C, 3N)."""
        count, n = len(self.laws), len(self.points)
        single = np.zeros((len(places), len(self.rods), n, 3))
        for i, (a, other) in enumerate(self.rods):
            far = places[:, other] if isinstance(other, int) else np.array([float(x) for x in other])
            single[:, i, a] += places[:, a] - far
            if isinstance(other, int):
                single[:, i, other] -= places[:, a] - far
        found = np.zeros((len(places), count, n, 3))
        for k, law in enumerate(self.laws):
            for i, weight in zip(law.rods, law.weights, strict=True):
                length = float(self.square(i)[1]) ** 0.5
                scale = {"distance": 1 / length, "root": -1 / length, "square": 2.0}.get(
                    law.form, 2 * float(weight)
                )
                found[:, k] += scale * single[:, i]
        return found.reshape(len(places), count, 3 * n)

    def document(self, velocities=None, places=None, laws=None):
        """The model; `laws` replaces the texts of the equations."""
        lines = ["lagcli: 1", "particles:"]
        for k, mass in enumerate(self.masses):
            place = [float(x) for x in (self.points[k] if places is None else places[k])]
            speed = [0.0] * 3 if velocities is None else [float(x) for x in velocities[k]]
            lines.append(f"  {NAMES[k]}: {{mass: {mass}, position: {place}, velocity: {speed}}}")
        lines += ["forces:", "  weight: {to: all, force: [0, 0, -9.81*m]}", "  drag: {to: a, force: -0.3*v}"]
        lines.append("holonomic:")
        for name, text in zip(self.names, laws or map(self.text_of, self.laws), strict=True):
            lines.append(f'  {name}: "{text}"')
        return "\n".join(lines) + "\n"

    def only(self, kept):
        """The framework with these rows alone, which keep their names by their place."""
        return dataclasses.replace(self, laws=tuple(self.laws[k] for k in kept))


halves = st.integers(-4, 4).map(lambda i: Fraction(i, 2))
places = st.tuples(halves, halves, halves)
weights = st.sampled_from([Fraction(1), Fraction(2), Fraction(-3), Fraction(1, 4), Fraction(5, 2)])


@st.composite
def frameworks(draw, extra=(0, 3), most=5):
    """Connected or not, anchored or not, flexible to over-braced; then copies and combinations, in any order."""
    count = draw(st.integers(2, most))
    points = draw(st.lists(places, min_size=count, max_size=count, unique=True))
    pairs = list(itertools.combinations(range(count), 2))
    rods = draw(st.lists(st.sampled_from(pairs), min_size=1, max_size=len(pairs), unique=True))
    for k in draw(st.lists(st.integers(0, count - 1), max_size=3)):
        anchor = draw(places)
        if anchor != points[k] and (k, anchor) not in rods:
            rods.append((k, anchor))
    laws = [draw(single(i)) for i in range(len(rods))]
    for _ in range(draw(st.integers(*extra))):
        if len(rods) > 1 and draw(st.booleans()):
            chosen = draw(st.lists(st.integers(0, len(rods) - 1), min_size=2, max_size=3, unique=True))
            laws.append(Law(tuple(chosen), tuple(draw(weights) for _ in chosen), "combination"))
        else:
            laws.append(draw(single(draw(st.integers(0, len(rods) - 1)))))
    masses = tuple(draw(st.sampled_from(MASSES)) for _ in points)
    return Framework(tuple(points), masses, tuple(rods), tuple(draw(st.permutations(laws))))


@st.composite
def single(draw, rod):
    form = draw(st.sampled_from(("distance", "root", "square", "scaled")))
    return Law((rod,), (draw(weights) if form == "scaled" else Fraction(1),), form)


# Counts and names.


@given(frameworks())
@settings(max_examples=60)
def test_count_and_redundant_names_are_those_of_exact_ranks(frame):
    found = lagcli.dof(lagcli.loads(frame.document()))
    rank = exact_rank.rank(frame.matrix)
    free = 3 * len(frame.points) - rank
    assert found.bounds[0] <= found.bounds[1] <= 3 * len(frame.points)
    if frame.is_regular:
        assert found.configuration_dof == found.velocity_dof == free
        assert found.redundant == len(frame.laws) - rank
        assert set(found.redundant_rows) == {frame.names[k] for k in exact_rank.redundant(frame.matrix)}
    elif found.configuration_dof is None:
        assert found.reason
        assert found.proof == "none"
    else:
        # A surface is nowhere larger than its tangent space.
        assert found.configuration_dof <= free


@given(frameworks())
@settings(max_examples=40)
def test_flags_of_unique_multipliers_are_those_of_exact_null_vectors(frame):
    assume(frame.is_regular)
    report = lagcli.check(lagcli.loads(frame.document()))
    assert redundant(report) == {frame.names[k] for k in exact_rank.redundant(frame.matrix)}
    assert not_unique(report) == {frame.names[k] for k in exact_rank.shared(frame.matrix)}


# Runs: motion, R and the split.

BRIEF = {"duration": 0.05, "samples": 6, "rtol": 1e-11, "atol": 1e-13}


def speeds_of(frame, seed):
    """Velocities the rows allow, nearest to random ones."""
    wanted = np.random.default_rng(seed).uniform(-1, 1, 3 * len(frame.points))
    B = np.array(frame.matrix, float)
    return (wanted - np.linalg.pinv(B, rcond=1e-10) @ (B @ wanted)).reshape(-1, 3)


def table(run, count, pattern):
    return np.stack(
        [[run[pattern.format(NAMES[k], axis)] for axis in "xyz"] for k in range(count)], axis=0
    ).transpose(2, 0, 1)


def least(frame, places, reactions):
    """The multipliers (T, C) with these R and the least sum of lambda_i^2 B_i M^-1 B_i^T, by pseudo-inverses."""
    root = np.repeat(np.sqrt(frame.masses), 3)
    found = []
    for B, R in zip(frame.gradients(places), reactions.reshape(len(places), -1), strict=True):
        weighted = B / root
        sizes = np.linalg.norm(weighted, axis=1)
        found.append(np.linalg.pinv((weighted / sizes[:, None]).T, rcond=1e-7) @ (R / root) / sizes)
    return np.array(found)


@given(frameworks(extra=(1, 3), most=4), st.integers(0, 2**16))
@settings(max_examples=25)
def test_run_with_redundant_rows_is_the_run_without(frame, seed):
    assume(frame.is_regular)
    speeds, count = speeds_of(frame, seed), len(frame.points)
    doubled = lagcli.simulate(lagcli.loads(frame.document(speeds)), **BRIEF)
    kept = [k for k in range(len(frame.laws)) if k not in exact_rank.redundant(frame.matrix)]
    independent = lagcli.simulate(lagcli.loads(frame.only(kept).document(speeds)), **BRIEF)
    place, R = table(doubled, count, "{}.{}"), table(doubled, count, "R.{}.{}")
    np.testing.assert_allclose(place, table(independent, count, "{}.{}"), rtol=0, atol=SAME)
    R_lean = table(independent, count, "R.{}.{}")
    np.testing.assert_allclose(R, R_lean, rtol=0, atol=SAME * max(1.0, np.abs(R_lean).max()))
    assert indeterminate(doubled) == {frame.names[k] for k in exact_rank.shared(frame.matrix)}
    lam = np.stack([doubled.multiplier(name) for name in frame.names], axis=1)
    expected = least(frame, place, R)
    np.testing.assert_allclose(lam, expected, rtol=0, atol=1e-8 * max(1.0, np.abs(expected).max()))
    # R = B^T lambda, by gradients of our own.
    forces = np.einsum("tcn,tc->tn", frame.gradients(place), lam)
    np.testing.assert_allclose(forces, R.reshape(len(R), -1), rtol=0, atol=1e-8 * max(1.0, np.abs(R).max()))


@given(frameworks(extra=(0, 2), most=4), st.integers(0, 2**16))
@settings(max_examples=12)
def test_start_off_the_rows_is_refused_by_name_and_assembled(frame, seed):
    assume(frame.is_regular)
    dice = np.random.default_rng(seed)
    moved = np.array(frame.points, float) + dice.uniform(-0.02, 0.02, (len(frame.points), 3))
    model = lagcli.loads(frame.document(places=moved))
    with pytest.raises(lagcli.ModelError) as refused:
        lagcli.simulate(model, **BRIEF)
    told = " ".join(d.message for d in refused.value.diagnostics)
    assert any(re.search(rf"\b{name}\b", told) for name in frame.names)
    run = lagcli.simulate(model, assemble=True, **BRIEF)
    assert run.stats.position_drift <= ON
    lengths = [float(frame.square(i)[1]) for i in range(len(frame.rods))]
    place = table(run, len(frame.points), "{}.{}")
    for i, (a, other) in enumerate(frame.rods):
        far = place[:, other] if isinstance(other, int) else np.array([float(x) for x in other])
        np.testing.assert_allclose(((place[:, a] - far) ** 2).sum(axis=1), lengths[i], rtol=0, atol=1e-8)


@given(frameworks(extra=(0, 1), most=3), st.data())
@settings(max_examples=5)
def test_second_length_of_one_rod_is_contradictory(frame, data):
    assume(frame.is_regular)
    alone = [law for law in frame.laws if law.form != "combination"]
    law = data.draw(st.sampled_from(alone))
    frame = dataclasses.replace(frame, laws=(*frame.laws, law))
    texts = [frame.text_of(one) for one in frame.laws[:-1]] + [frame.text_of(law, Fraction(1, 3))]
    for question in (lagcli.dof, lagcli.check, lagcli.simulate):
        with pytest.raises(lagcli.ModelError) as refused:
            question(lagcli.loads(frame.document(laws=texts)))
        (diagnostic,) = refused.value.diagnostics
        assert diagnostic.code == "contradictory-constraints"
        assert f"`{frame.names[-1]}`" in diagnostic.message


# Frameworks with names.

CUBE = [tuple(map(Fraction, corner)) for corner in itertools.product((0, 1), repeat=3)]
SKEW = [tuple(Fraction(k**power % 7, 2) for power in (1, 2, 3)) for k in range(6)]
SQUARE = [tuple(map(Fraction, corner)) for corner in ((0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0))]
LINE = [(Fraction(x), Fraction(0), Fraction(0)) for x in (-1, 0, 1)]


def complete(points):
    """All pairs joined, by lengths."""
    rods = tuple(itertools.combinations(range(len(points)), 2))
    laws = tuple(Law((i,), (Fraction(1),), "distance") for i in range(len(rods)))
    return Framework(tuple(points), (1.0,) * len(points), rods, laws)


@pytest.mark.parametrize(
    ("points", "rank"), [(SKEW[:5], 9), (SKEW, 12), (CUBE, 18)], ids=["K5", "K6", "cube"]
)
def test_bodies_with_all_their_distances(points, rank):
    frame = complete(points)
    assert exact_rank.rank(frame.matrix) == rank
    model = lagcli.loads(frame.document())
    count = lagcli.dof(model)
    assert (count.configuration_dof, count.redundant) == (6, len(frame.rods) - rank)
    independent = frame.only(
        [k for k in range(len(frame.rods)) if k not in exact_rank.redundant(frame.matrix)]
    )
    doubled, independent = (
        lagcli.simulate(model, **BRIEF),
        lagcli.simulate(lagcli.loads(independent.document()), **BRIEF),
    )
    R = table(doubled, len(points), "R.{}.{}")
    np.testing.assert_allclose(R, table(independent, len(points), "R.{}.{}"), rtol=0, atol=SAME)
    assert indeterminate(doubled) == {frame.names[k] for k in exact_rank.shared(frame.matrix)}


@pytest.mark.parametrize(
    ("points", "counts"), [(LINE, (6, 7, 5)), (SQUARE, (6, 7, 6))], ids=["line", "square"]
)
def test_rank_below_the_codimension_is_never_run(points, counts):
    frame = complete(points)
    n, rows, truth = 3 * len(points), len(frame.rods), counts[2]
    assert counts[:2] == (n - rows, n - exact_rank.rank(frame.matrix))
    assert lagcli.dof(lagcli.loads(frame.document())).configuration_dof in (None, truth)
    with pytest.raises(lagcli.ModelError) as refused:
        lagcli.simulate(lagcli.loads(frame.document()), **BRIEF)
    (diagnostic,) = refused.value.diagnostics
    assert all(f"`{name}`" in diagnostic.message for name in frame.names)
    assert "rigid" in diagnostic.hint


def bricard(c=Fraction(1, 4)):
    """Ends of the pins of the four free joints, and rods in the order of the gallery's model: pins, then rods."""
    joints = [(0, 0, 0), (1, 0, 0), (1, 1, 0), (1, 1, 1), (0, 1, 1), (0, 0, 1)]
    axes = [1, 2, 0, 1, 2, 0]
    ends = [
        [tuple(Fraction(x) + (sign * c if axis == k else 0) for k, x in enumerate(joint)) for sign in (1, -1)]
        for joint, axis in zip(joints, axes, strict=True)
    ]
    rods = [(2 * k, 2 * k + 1) for k in range(4)]
    for k in range(5):
        for i, j in itertools.product((0, 1), repeat=2):
            here = 2 * (k - 1) + i if k > 0 else ends[0][i]
            there = 2 * k + j if k < 4 else ends[5][j]
            rods.append((here, there) if k > 0 else (there, here))
    return [end for pair in ends[1:5] for end in pair], rods


def test_linkage_of_bricard_has_one_row_more_than_its_rank():
    points, rods = bricard()
    matrix = exact_rank.rigidity(points, rods)
    model = lagcli.load(pathlib.Path(__file__).parents[2] / "models" / "bricard.yaml")
    start = lagcli.simulate(model, duration=0)
    names = [f"p{k}[{j}]" for k in (1, 2, 3, 4) for j in (0, 1)]
    assert [[start[f"{name}.{axis}"][0] for axis in "xyz"] for name in names] == [
        [float(x) for x in p] for p in points
    ]
    assert (len(matrix), exact_rank.rank(matrix)) == (24, 23)
    assert exact_rank.generic_rank(8, 3, rods) == 24
    assert exact_rank.shared(matrix) == set(range(4, 24))


# The N-fold four-bar linkage through its crossings.


def reduced(windows, t):
    """phi and its rate: all cranks turn alike, by the Lagrangian of one freedom."""
    pull = 9.81 * ((windows + 1) / 2 + windows) / ((windows + 1) / 3 + windows)
    rates = lambda _, y: [y[1], pull * np.sin(y[0])]  # noqa: E731
    found = scipy.integrate.solve_ivp(rates, (0, t), [0, 1], method="DOP853", rtol=1e-13, atol=1e-13)
    return found.y[:, -1]


@functools.cache
def four_bars(windows):
    path = pathlib.Path(__file__).parents[2] / "models" / "double-four-bar.yaml"
    return lagcli.load(path, parameters={"N": windows})


def error(run, windows):
    phi, rate = reduced(windows, run.t[-1])
    tops = [(run[f"p[{k}].x"][-1] - k, run[f"p[{k}].z"][-1]) for k in range(windows + 1)]
    speeds = [(run[f"p[{k}].vx"][-1], run[f"p[{k}].vz"][-1]) for k in range(windows + 1)]
    wanted = np.sin(phi), np.cos(phi)
    return max(
        np.abs(np.subtract(tops, wanted)).max(),
        np.abs(np.subtract(speeds, (rate * wanted[1], -rate * wanted[0]))).max() / abs(rate),
    )


def test_reduced_problem_is_that_of_the_reference():
    assert reduced(2, 10) == pytest.approx((31.75059718698610181708135, 1.506642180841829469894272), abs=1e-9)


@pytest.mark.parametrize("rtol", [1e-4, 1e-5, 1e-6, 1e-7, 1e-8, 1e-9, 1e-10, 1e-11, 1e-12])
def test_double_four_bar_passes_ten_crossings_at_every_tolerance(rtol):
    run = lagcli.simulate(four_bars(2), rtol=rtol, atol=rtol / 100, samples=11)
    assert error(run, 2) <= max(1e-9, 3 * rtol)
    assert run.stats.position_drift <= 1e-12


@pytest.mark.parametrize("windows", [1, 3, 40])
def test_other_numbers_of_windows(windows):
    run = lagcli.simulate(four_bars(windows), samples=2)
    assert error(run, windows) <= 1e-6


def test_row_at_a_crossing_has_its_motion():
    instant = scipy.optimize.brentq(lambda t: np.cos(reduced(2, t)[0]), 0.5, 1.0, xtol=1e-15)
    run = lagcli.simulate(four_bars(2), duration=instant, samples=3)
    assert error(run, 2) <= 1e-8


# Differential rows.

DISK = """
lagcli: 1
parameters: {{M: 2, a: 0.5, J: 0.25, I: 0.125}}
coordinates:
  x: {{}}
  y: {{}}
  theta: {{value: 0.3, rate: 1}}
  phi: {{rate: 2}}
lagrangian: M*(rate(x)**2 + rate(y)**2)/2 + I*rate(theta)**2/2 + J*rate(phi)**2/2
forces:
  push: {{to: x, force: 1}}
differential:
{rows}
simulation: {{duration: 1, samples: 11, rtol: 1e-11, atol: 1e-13, assemble: true}}
"""
ROLL = ("({0})*(d(x) - a*cos(theta)*d(phi))", "({0})*(d(y) - a*sin(theta)*d(phi))")
factors = st.sampled_from(("1", "2", "-0.5", "(1 + x**2)", "cos(y)", "(2 + sin(theta))"))


@st.composite
def rolling(draw):
    """Rows (text, weights on the two rolling rows that are not zero), two independent ones among them."""
    rows = [(ROLL[0].format(draw(factors)), {0}), (ROLL[1].format(draw(factors)), {1})]
    # One row of both: two might be alike at the start only.
    for both in draw(st.sampled_from(([{0}], [{1}], [{0, 1}], [{0, 1}, {0}], [{1}, {0, 1}], [{1}, {1}]))):
        rows.append((" + ".join(ROLL[i].format(draw(factors)) for i in sorted(both)), both))
    return draw(st.permutations(rows))


def symbolic(rows):
    """Exact rows with weights of no special value: the supports of the null vectors."""
    generic = iter(
        Fraction(p, q)
        for p, q in ((3, 7), (-5, 11), (13, 17), (19, 23), (-29, 31), (37, 41), (43, 47), (53, 59))
    )
    return [[next(generic) if i in both else Fraction(0) for i in (0, 1)] for _, both in rows]


@given(rolling())
@settings(max_examples=8)
def test_redundant_differential_rows(rows):
    names = [f"row{k}" for k in range(len(rows))]
    text = "\n".join(f"  {name}: {law} = 0" for name, (law, _) in zip(names, rows, strict=True))
    plain = DISK.format(rows="\n".join(f"  r{i}: {law.format('1')} = 0" for i, law in enumerate(ROLL)))
    exact = symbolic(rows)
    model = lagcli.loads(DISK.format(rows=text))
    report = lagcli.check(model)
    count = report.dof
    assert (count.configuration_dof, count.velocity_dof, count.redundant) == (4, 2, len(rows) - 2)
    assert redundant(report) == {names[k] for k in exact_rank.redundant(exact)}
    assert not_unique(report) == {names[k] for k in exact_rank.shared(exact)}
    doubled, independent = lagcli.simulate(model), lagcli.simulate(lagcli.loads(plain))
    for column in ("x", "y", "phi", "R.x", "R.y", "R.phi"):
        np.testing.assert_allclose(doubled[column], independent[column], rtol=0, atol=SAME)
    assert indeterminate(doubled) == {names[k] for k in exact_rank.shared(exact)}
