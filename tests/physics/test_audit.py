"""The second opinion: right tables pass, wrong ones are found and named, and nothing of the solver is used."""

import ast
import json
import re
import subprocess
import sys
import warnings
from pathlib import Path

import numpy as np
import numpy.typing as npt
import pytest

import lagcli
from lagcli.auditing.checks import checks_lagrangian
from lagcli.auditing.checks.audit_report import Audit, Law, judge
from lagcli.auditing.evidence import differences, model_values, table_input
from lagcli.auditing.evidence.laws import ModelLaws
from lagcli.auditing.evidence.model_values import ModelIndex, ModelOnTable
from lagcli.auditing.evidence.tolerances import Evidence, Tolerance
from lagcli.output.figures import result_figures
from lagcli.output.tables import sinks, table_format
from lagcli.running.trajectory import Trajectory
from tests.helpers.in_process import Command, command
from tests.helpers.spent import at_most_calls

__all__ = ["command"]

ROOT = Path(__file__).resolve().parents[2]
GALLERY = sorted((ROOT / "models").glob("*.yaml"))
Floats = npt.NDArray[np.float64]

DOUBLE = """\
lagcli: 1
title: A double pendulum with friction
parameters: {m: 1, g: 9.81, c: 0.1}
particles:
  a: {mass: m, position: [0.6, 0, -0.8]}
  b: {mass: 2*m, position: [0.6, 0, -1.8], velocity: [0, 1, 0]}
forces:
  weight: {to: all, force: [0, 0, -m*g]}
  drag: {to: all, force: -c*v}
holonomic:
  upper: norm(a) = 1
  lower: distance(a, b) = 1
simulation: {duration: 1, samples: 201}
"""

MIXED = """\
lagcli: 1
title: Everything at once
parameters: {m: 1.5, g: 9.81, w: 0.7, k: 3}
coordinates:
  s: {value: 0.3, rate: 0.2}
  phi: {value: 0.4, rate: -0.5}
particles:
  p[i]: {for: "i = 1..3", mass: m*i, position: ["i - 2 + 0.1*i**2", "0.2*i", "0.5 - 0.1*i"]}
  e: {mass: 2, position: ["s*cos(phi) + sin(w*t)", "s*sin(phi)", "s**2/2"]}
  f: {mass: 1, position: ["e.x + cos(phi)", "e.y + sin(phi)", "e.z - t/5"]}
definitions:
  gap: distance(p[1], p[3])
lagrangian: rate(s)**2*(1 + s**2)/2 - k*phi**4/24
forces:
  weight: {to: all, force: [0, 0, -m*g]}
  drag: {to: [e, f], force: -0.1*v}
  spring: {potential: "k/2*(distance(p[2], e) - 1)**2"}
  motor: {to: phi, force: cos(t)}
holonomic:
  link[i]: {for: "i = 1..2", equation: "distance(p[i], p[i+1])**2 = 1 + i/10 + sin(t)/7"}
  along: p[1] - p[2] = [0, 0, 0]
differential:
  roll: cos(phi)*d(p[3].x) + d(sin(s)*p[2].y) - s*d(phi) + t*dt = 0
  lead: rate(s) - e.vx*phi + norm(p[1])*rate(p[3].y) = w
"""


def table(model: lagcli.Model, **options: object) -> Trajectory:
    return lagcli.simulate(model, **options)


def with_rows(run: Trajectory, rows: Floats) -> Trajectory:
    return Trajectory(run.columns, rows, run.stats)


def failing(found: Audit) -> dict[str, list[str]]:
    return {c.name: [place.name for place in c.failing] for c in found.checks if c.verdict == "fail"}


@pytest.fixture(scope="module")
def double() -> tuple[lagcli.Model, Trajectory]:
    model = lagcli.loads(DOUBLE)
    return model, table(model)


@pytest.mark.parametrize("path", GALLERY, ids=lambda path: path.stem)
def test_the_gallery_is_clean(path: Path) -> None:
    found = lagcli.audit(lagcli.load(path))
    assert found.passed, failing(found)
    judged = {check.name for check in found.checks if check.judged}
    assert {"rates", "newton", "reactions", "ideal", "energy", "momenta"} <= judged | {
        check.name for check in found.checks if check.verdict == "nothing"
    }


# Faults: what is done to the column, and the check and the name that must come out.


def faults(run: Trajectory) -> dict[str, tuple[Floats, str, str]]:
    """Each fault with the table that has it, a check that must fail, and a name that check must give."""
    places = {name: i for i, name in enumerate(run.columns)}
    found = {}

    def one(key: str, check: str, name: str) -> Floats:
        rows = run.rows.copy()
        found[key] = (rows, check, name)
        return rows

    one("multiplier", "multipliers", "lower")[:, places["lambda.lower"]] *= 1.001
    one("one multiplier", "multipliers", "upper")[77, places["lambda.upper"]] *= 1.001
    one("sign", "reactions", "R.b.z")[:, places["R.b.z"]] *= -1
    one("sign in Newton", "newton", "R.b.z")[:, places["R.b.z"]] *= -1
    one("one velocity", "rates", "b.vy")[100, places["b.vy"]] += 1e-6
    one("velocity", "rates", "b.vx")[:, places["b.vx"]] += 1e-6
    swapped = [places["lambda.upper"], places["lambda.lower"]]
    one("swap", "multipliers", "upper")[:, swapped] = run.rows[:, swapped[::-1]]
    span = np.linspace(0, 1, len(run.rows))
    one("drift", "positions", "upper")[:, places["a.z"]] += 1e-6 * span
    one("drift of a path", "path", "b.y")[:, places["b.y"]] += 1e-6 * span
    a = np.stack([run.rows[:, places[f"a.{axis}"]] for axis in "xyz"], axis=1)
    tangent = np.cross(a, [0.0, 1.0, 0.0])
    rows = one("tangential", "ideal", "R.a.x")
    rows[:, [places[f"R.a.{axis}"] for axis in "xyz"]] += 1e-6 * tangent
    one("no number", "numbers", "b.x")[5, places["b.x"]] = np.nan
    one("no multiplier", "multipliers", "upper")[5, places["lambda.upper"]] = np.nan
    return found


FAULTS = (
    "multiplier", "one multiplier", "sign", "sign in Newton", "one velocity", "velocity", "swap", "drift",
    "drift of a path", "tangential", "no number", "no multiplier",
)  # fmt: skip


@pytest.mark.parametrize("fault", FAULTS)
def test_a_fault_is_found_and_named(double: tuple[lagcli.Model, Trajectory], fault: str) -> None:
    model, run = double
    rows, check, name = faults(run)[fault]
    found = lagcli.audit(model, with_rows(run, rows))
    assert not found.passed
    assert name in failing(found)[check]


def test_the_right_table_passes(double: tuple[lagcli.Model, Trajectory]) -> None:
    model, run = double
    found = lagcli.audit(model, run)
    assert found.passed
    assert not found.unjudged
    assert not found.notes
    # Limits are no excuse: what is right is far below, and a part in a thousand of R far above.
    newton = found.check("newton").worst
    assert newton is not None
    assert newton.limit < 1e-4


@pytest.mark.parametrize(
    ("model", "column"),
    [
        ("rolling-disk", "lambda.roll_y"),
        ("pendulum-angle", "R.a.x"),
        ("water-molecule", "R.H1.x"),
        ("pursuit", "rate(x)"),
        ("bead-on-rotating-hoop", "bead.vy"),
        ("twin-rod", "R.a.z"),
        ("knife-edge", "rate(y)"),
    ],
)
def test_faults_of_other_kinds_of_models(model: str, column: str) -> None:
    read = lagcli.load(ROOT / "models" / f"{model}.yaml")
    run = table(read)
    assert lagcli.audit(read, run).passed
    rows = run.rows.copy()
    place = run.columns.index(column)
    rows[len(rows) // 3, place] += 1e-6 * max(1.0, float(np.abs(rows[:, place]).max()))
    named = {name for names in failing(lagcli.audit(read, with_rows(run, rows))).values() for name in names}
    assert named & {column, column.removeprefix("lambda."), column.removeprefix("rate(").removesuffix(")")}


def test_work_on_a_moving_ramp() -> None:
    found = lagcli.audit(lagcli.load(ROOT / "models" / "moving-ramp-stick.yaml"))
    figures = dict(found.figures)
    assert found.passed
    assert figures["virtual_work"] <= 1e-10
    assert abs(figures["work_of_constraints"]) > 1
    assert figures["work_of_constraints"] == pytest.approx(figures["energy_gained"], rel=1e-8)


def test_symmetries_are_reported() -> None:
    found = lagcli.audit(lagcli.load(ROOT / "models" / "rolling-disk.yaml"))
    note = found.check("momenta").note
    assert "cyclic x: J goes from 0 to" in note
    assert "by the constraints" in note
    assert "cyclic theta: J = 0.15625 is conserved" in note


def test_what_is_determined_is_reported() -> None:
    twin = lagcli.audit(lagcli.load(ROOT / "models" / "twin-rod.yaml"))
    assert any("2 of 3 multipliers are not determined (`rod`, `twin`)" in line for line in twin.sentences)
    independent = lagcli.audit(lagcli.load(ROOT / "models" / "pendulum.yaml"))
    assert any("lambda(0) too" in line for line in independent.sentences)


def test_a_row_at_a_crossing_needs_no_multiplier() -> None:
    model = lagcli.load(ROOT / "models" / "double-four-bar.yaml")
    first = table(model, duration=1.0, samples=11).stats.singular_times[0]
    run = table(model, duration=first, samples=201)
    assert np.isnan(run.rows[-1]).any()
    assert lagcli.audit(model, run).passed


@pytest.mark.parametrize("samples", [2, 5, 9, 13, 21])
def test_coarse_tables_are_not_judged_beyond_what_they_show(samples: int) -> None:
    model = lagcli.load(ROOT / "models" / "double-pendulum.yaml")
    run = table(model, samples=samples)
    found = lagcli.audit(model, run)
    assert found.passed, failing(found)
    assert {"newton", "rates"} <= set(found.unjudged)
    # What each row must stand alone is judged all the same.
    rows = run.rows.copy()
    rows[-1, run.columns.index("lambda.upper" if "lambda.upper" in run.columns else lambdas(run)[0])] *= 1.001
    assert not lagcli.audit(model, with_rows(run, rows)).passed


def lambdas(run: Trajectory) -> list[str]:
    return [name for name in run.columns if name.startswith("lambda.")]


@pytest.mark.parametrize("seed", range(4))
def test_right_tables_at_any_tolerance_pass(seed: int) -> None:
    random = np.random.default_rng(seed)
    model = lagcli.loads(DOUBLE, {"c": float(random.uniform(0, 0.5)), "m": float(random.uniform(0.1, 10))})
    rtol = float(10.0 ** -random.integers(4, 13))
    options = {
        "duration": float(random.uniform(0.1, 4)), "samples": int(random.integers(2, 400)), "rtol": rtol,
        "atol": rtol / 100,
    }  # fmt: skip
    run = table(model, **options)
    found = lagcli.audit(model, run, rtol=rtol, atol=rtol / 100)
    assert found.passed, failing(found)


# The table: what is read, and what is refused.


@pytest.mark.parametrize("ending", ["csv", "json", "npz", "parquet"])
def test_tables_are_read_as_they_are_written(
    double: tuple[lagcli.Model, Trajectory], tmp_path: Path, ending: str
) -> None:
    model, run = double
    path = tmp_path / f"run.{ending}"
    rows = run.rows.copy()
    rows[3, run.columns.index("lambda.upper")] = np.nan
    with sinks.open_sink(path, run.columns) as sink:
        sink.write(rows)
    columns, back = table_format.read(path)
    assert columns == run.columns
    np.testing.assert_array_equal(back, rows)
    assert failing(lagcli.audit(model, path)) == {"multipliers": ["upper"]}


@pytest.mark.parametrize(
    ("name", "text"),
    [
        ("run.csv", "t,a.x\n0,1,2\n"),
        ("run.csv", "t,a.x\n0,one\n"),
        ("run.csv", "t,t\n0,1\n"),
        ("run.json", '{"columns": ["t"]}'),
        ("run.json", "nothing"),
        ("run.npz", "nothing"),
    ],
)
def test_what_is_no_table_is_refused(tmp_path: Path, name: str, text: str) -> None:
    path = tmp_path / name
    path.write_text(text, encoding="utf-8")
    with pytest.raises(table_format.UnreadableTable):
        table_format.read(path)


def test_missing_columns_are_named(double: tuple[lagcli.Model, Trajectory]) -> None:
    model, run = double
    kept = [i for i, name in enumerate(run.columns) if name not in ("lambda.lower", "R.a.y")]
    partial = Trajectory(tuple(run.columns[i] for i in kept), run.rows[:, kept], run.stats)
    with pytest.raises(table_input.TableError, match=r"lacks 2 of the .* `lambda.lower`, `R.a.y`"):
        lagcli.audit(model, partial)


def test_a_table_of_another_model_is_noticed(double: tuple[lagcli.Model, Trajectory]) -> None:
    model, run = double
    with pytest.raises(table_input.TableError, match="another model"):
        lagcli.audit(lagcli.load(ROOT / "models" / "pendulum.yaml"), run)
    other = lagcli.loads(DOUBLE, {"g": 9.8})
    assert "newton" in failing(lagcli.audit(other, run))
    moved = lagcli.loads(DOUBLE, {"b.vy": 0.9}) if "b.vy" in run.columns else model
    if moved is not model:
        found = lagcli.audit(moved, run)
        assert found.passed
        assert "another start" in found.notes[0]


def test_times_must_increase(double: tuple[lagcli.Model, Trajectory]) -> None:
    model, run = double
    with pytest.raises(table_input.TableError, match="do not increase: row 2"):
        lagcli.audit(model, with_rows(run, run.rows[::-1]))
    endless = run.rows.copy()
    endless[-2:, 0] = np.inf
    with warnings.catch_warnings():
        warnings.simplefilter("error")  # of libraries too: they would name their files
        with pytest.raises(table_input.TableError, match=r"do not increase: row .* at t = inf"):
            lagcli.audit(model, with_rows(run, endless))


def test_the_command(double: tuple[lagcli.Model, Trajectory], tmp_path: Path, command: Command) -> None:
    _, run = double
    file, good, bad = tmp_path / "double.yaml", tmp_path / "good.npz", tmp_path / "bad.csv"
    file.write_text(DOUBLE, encoding="utf-8")
    rows, _, _ = faults(run)["sign"]
    for path, values in ((good, run.rows), (bad, rows)):
        with sinks.open_sink(path, run.columns) as sink:
            sink.write(values)
    out, err, code = command("audit", str(file), "--run", str(good), "--plot", str(tmp_path / "audit.svg"))
    assert (code, err) == (0, "")
    assert "All checks passed." in out
    assert "newton" in (tmp_path / "audit.svg").read_text(encoding="utf-8")
    out, err, code = command("audit", str(file), "--run", str(bad), "--json")
    answer = json.loads(out)
    assert (code, err, answer["passed"]) == (1, "", False)
    reactions = next(check for check in answer["checks"] if check["name"] == "reactions")
    assert reactions["verdict"] == "fail"
    assert reactions["failing"][0]["name"] == "R.b.z"
    out, err, code = command("audit", str(file), "--run", str(bad))
    assert code == 1
    assert "reactions fails (D.22: R_k = sum_i lambda_i B_ik):\n  R.b.z at t = " in out


@pytest.mark.parametrize(
    "arguments",
    [
        ("--run", "missing.csv"),
        ("--run", "run.txt"),
        ("--plot", "figure.bmp"),
        ("--run", "{table}", "--duration", "1"),
        ("--run", "{table}"),
        ("--samples", "1"),
    ],
)
def test_what_cannot_be_done_is_usage(tmp_path: Path, command: Command, arguments: tuple[str, ...]) -> None:
    file, other = tmp_path / "double.yaml", tmp_path / "other.csv"
    file.write_text(DOUBLE, encoding="utf-8")
    other.write_text("t,lambda.rod\n0,1\n", encoding="utf-8")
    out, err, code = command("audit", str(file), *(a.format(table=other) for a in arguments))
    assert (code, out) == (2, "")
    assert err.startswith("lagcli: ")


def test_the_figure_has_a_strip_for_each_check(double: tuple[lagcli.Model, Trajectory]) -> None:
    model, run = double
    found = lagcli.audit(model, run)
    drawn = result_figures.audit(found)
    labels = [strip.get_ylabel() for strip in drawn.axes]
    assert labels == [check.name for check in found.checks if check.entries and check.law]


# The instruments by themselves.


def states(model: lagcli.Model, rows: int) -> tuple[Floats, Floats, Floats]:
    t0, q, v = model_values.start(model)
    random = np.random.default_rng(1)
    t = t0 + 0.3 + np.arange(rows) / 10
    return (
        t,
        q + 0.1 * random.standard_normal((rows, q.size)),
        v + 0.5 * random.standard_normal((rows, v.size)),
    )


def test_gradients_agree_with_differences() -> None:
    """B by differences of B v + b in v, which is linear; pull and forces of V by differences of f and V."""
    laws = ModelLaws(lagcli.loads(MIXED))
    t, q, v = states(laws.model, 4)
    B = laws.matrix(t, q, v)
    _, w = laws.residuals(t, q, v)
    for j in range(q.shape[1]):
        dv = np.zeros(q.shape)
        dv[:, j] = 1.0
        np.testing.assert_allclose(laws.residuals(t, q, v + dv)[1] - w, B[:, :, j], atol=1e-12)
    lam = np.random.default_rng(2).standard_normal((4, laws.C))
    values = laws.values(t, q, v, lam)
    np.testing.assert_allclose(values.pull, np.einsum("tci,tc->ti", B, lam), atol=1e-12)
    np.testing.assert_allclose(values.w, np.einsum("tci,ti->tc", B, v) + values.b, atol=1e-12)
    # f by the complex step, along every coordinate and along time.
    for j in range(q.shape[1]):
        dq = np.zeros(q.shape)
        dq[:, j] = 1.0
        f, _ = laws.residuals(t + 0j, q + 1e-100j * dq, v)
        np.testing.assert_allclose(f.imag / 1e-100, B[:, : laws.s, j], atol=1e-12)


def test_the_equations_of_lagrange_agree_with_those_of_the_solver() -> None:
    """h of the solver, by its own symbols, is what M a leaves of the audit's forces; dL/dq' its momentum."""
    model = lagcli.loads(MIXED.replace("  along: p[1] - p[2] = [0, 0, 0]\n", ""))
    laws = ModelLaws(model)
    t, q, v = states(model, 5)
    xi = np.random.default_rng(3).standard_normal(q.shape)
    step = 1e-100j
    L = laws.total_lagrangian
    slope = L(t + 0j, q + step * xi, v + 0j).imag / 1e-100
    near = (L(t, q + 1e-5 * xi, v) - L(t, q - 1e-5 * xi, v)) / 2e-5
    np.testing.assert_allclose(slope, near, rtol=1e-7)
    values = laws.values(t, q, v, np.zeros((5, laws.C)))
    np.testing.assert_allclose(laws.displaced(t, q, v, v) + values.x_t, values.u, atol=1e-12)
    F = np.random.default_rng(4).standard_normal(values.x.shape)
    power = (laws.pushed(t, q, v, F) * xi).sum(axis=1)
    np.testing.assert_allclose(power, (laws.displaced(t, q, v, xi) * F).sum(axis=1), atol=1e-12)


FUNCTIONS = (
    "sin(x)", "cos(x)", "tan(x)", "asin(x/3)", "acos(x/3)", "atan(x)", "sinh(x)", "cosh(x)", "tanh(x)", "exp(x)",
    "log(2 + x)", "sqrt(2 + x)", "abs(x - 5)", "atan2(x, y)", "min(x, y, 3)", "max(x, -y)", "x**3", "x**-2",
    "(2 + x)**0.5", "(2 + x)**y", "x/y", "-x*y*y", "norm([x, y, 1])", "dot(cross([x, y, 1], [y, 1, x]), [1, x, y])",
)  # fmt: skip


@pytest.mark.parametrize("text", FUNCTIONS)
def test_every_function_has_its_derivative(text: str) -> None:
    model = lagcli.loads(f"""\
lagcli: 1
coordinates: {{x: {{value: 0.7}}, y: {{value: 1.3}}}}
lagrangian: rate(x)**2 + rate(y)**2 + {text}
""")
    index = ModelIndex(model)
    q = np.array([[0.7, 1.3], [0.4, 0.9]])

    def value(at: npt.NDArray[np.complex128] | Floats) -> tuple[ModelOnTable, object]:
        from lagcli.expression import evaluate

        scene = ModelOnTable(index, np.zeros((2, 1)), at, np.zeros((2, 2)))
        assert model.lagrangian is not None
        return scene, evaluate.scalar(model.lagrangian.tree, scene.algebra())

    scene, node = value(q)
    gradient = scene.graph.gradient([(node, np.ones((1, 1)))])["q"]
    for j in range(2):
        dq = np.zeros((2, 2))
        dq[:, j] = 1.0
        up, down = (value(q + sign * 1e-5 * dq)[1].value[:, 0] for sign in (1, -1))  # type: ignore[attr-defined]
        np.testing.assert_allclose(gradient[:, j], (up - down) / 2e-5, rtol=1e-7, atol=1e-8)
        turned = value(q + 1e-100j * dq)[1].value[:, 0]  # type: ignore[attr-defined]
        np.testing.assert_allclose(np.imag(turned) / 1e-100, gradient[:, j], rtol=1e-12, atol=1e-13)


@pytest.mark.parametrize("rows", [9, 14, 40, 400])
@pytest.mark.parametrize("even", [True, False])
def test_derivatives_and_integrals_know_their_errors(rows: int, even: bool) -> None:
    t = np.linspace(0, 4, rows)
    if not even:
        t += 0.3 * (t[1] - t[0]) * np.sin(7 * t)
    grid = differences.DifferenceGrid(t)
    y = np.stack([np.sin(t), np.exp(-t) * np.cos(2 * t)], axis=1)
    slope = np.stack([np.cos(t), -np.exp(-t) * (np.cos(2 * t) + 2 * np.sin(2 * t))], axis=1)
    found = grid.derivative(y, np.full(2, 1e-15))
    assert (np.abs(found.value - slope) <= found.bound).all()
    back = grid.integral(slope, np.full(2, 1e-15))
    assert (np.abs(back.value - (y - y[0])) <= back.bound + 1e-15).all()
    if rows == 400:
        assert np.abs(found.value - slope)[8:-8].max() < 1e-11
        assert found.bound[8:-8].max() < 1e-10
        assert back.bound.max() < 1e-10


def test_what_is_too_fast_is_not_resolved() -> None:
    t = np.linspace(0, 10, 101)
    grid = differences.DifferenceGrid(t)
    y = np.stack([np.sin(t), np.sin(25 * t)], axis=1)
    resolved = grid.resolved(y, np.full(2, 1e-14))
    assert resolved[:, 0].all()
    assert not resolved[10:-10, 1].any()


def test_symmetries_are_found_where_they_are() -> None:
    model = lagcli.load(ROOT / "models" / "spherical-pendulum.yaml")
    run = table(model, duration=1, samples=101)
    laws = ModelLaws(model)
    found = Evidence(laws, table_input.read(laws, run.columns, run.rows), Tolerance(1e-11, 1e-13))
    names = {one.name for one in checks_lagrangian.symmetries(found)}
    assert names == {"translation along x", "translation along y", "rotation about z"}


def test_a_residual_that_is_no_number_fails() -> None:
    law = Law("any", "D.0", "0 = 0")
    check = judge(law, ["a"], np.zeros(1), np.full((1, 1), np.nan), np.ones((1, 1)))
    assert check.verdict == "fail"
    open_ = judge(law, ["a"], np.zeros(1), np.ones((1, 1)), np.ones((1, 1)), np.zeros((1, 1), dtype=bool))
    assert open_.verdict == "not judged"


def test_every_check_stands_in_the_page_of_the_audit() -> None:
    page = (ROOT / "docs" / "explanation" / "audit.md").read_text(encoding="utf-8")
    told = re.findall(r"^\| `(\w+)` \|", page, flags=re.MULTILINE)
    files = (ROOT / "lagcli" / "auditing").rglob("*.py")
    laws = re.findall(r'Law\(\s*"(\w+)"', "\n".join(path.read_text(encoding="utf-8") for path in files))
    assert len(laws) > 30
    assert sorted(laws) == sorted(told)


OF_THE_AUDIT = tuple(f"lagcli.{room}" for room in ("auditing", "model", "expression", "errors", "arrays"))


def test_nothing_of_the_solver_is_used() -> None:
    # The coefficients of a body, and the digits of doubles: plain numbers.
    allowed = {"lagcli.equations.rigid", "lagcli.doubles"}
    paths = list((ROOT / "lagcli" / "auditing").rglob("*.py"))
    assert len(paths) > 20
    for path in paths:
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            names = []
            if isinstance(node, ast.ImportFrom):
                names = [f"{node.module}.{alias.name}" for alias in node.names]
            elif isinstance(node, ast.Import):
                names = [alias.name for alias in node.names]
            for name in names:
                own = name.startswith(OF_THE_AUDIT) or name in allowed
                assert own or not name.startswith(("lagcli", "casadi", "scipy", "sympy")), (path, name)
    text = "import sys, lagcli.auditing.all_checks; print('casadi' in sys.modules, 'scipy' in sys.modules)"
    answer = subprocess.run([sys.executable, "-c", text], capture_output=True, text=True, check=True)
    assert answer.stdout.split() == ["False", "False"]


def test_an_audit_looks_at_all_rows_together() -> None:
    """Twenty rows or two thousand take calls by the thousand and no more: an audit costs less than the run."""
    model = lagcli.load(ROOT / "models" / "chain.yaml")
    for samples in (21, 2001):
        run = lagcli.simulate(model, samples=samples)
        with at_most_calls(250_000):
            assert lagcli.audit(model, run).passed


def test_digits_of_a_table_are_those_of_the_run_that_made_it() -> None:
    model = lagcli.load(ROOT / "models" / "double-pendulum.yaml")
    run = lagcli.simulate(model, duration=3, samples=31, rtol=1e-7, digits=True)
    plain = lagcli.simulate(model, duration=3, samples=31, rtol=1e-7)
    found = lagcli.audit(model, plain, rtol=1e-7, digits=True)
    assert found.digits["digits"] == run.digits
    assert found.as_json()["accuracy"]["digits"] == run.digits
    assert run.stats.accuracy.sentence in found.sentences
    # A table that is off has fewer digits.
    rows = plain.rows.copy()
    rows[10:, plain.columns.index("a.vx")] += 1e-3
    off = lagcli.audit(model, with_rows(plain, rows), rtol=1e-7, digits=True)
    assert not off.passed
    assert off.digits["errors"]["v"] == pytest.approx(1e-3, rel=1e-3)
    assert off.digits["errors"]["r"] == found.digits["errors"]["r"]


def test_digits_are_refused_for_rows_of_other_times() -> None:
    model = lagcli.load(ROOT / "models" / "pendulum.yaml")
    run = lagcli.simulate(model, duration=1, samples=11)
    for rows in (run.rows[1:], run.rows[[0, 1, 2, 4, 5]], run.rows[:1]):
        with pytest.raises(ValueError, match="digits: the"):
            lagcli.audit(model, with_rows(run, rows), digits=True)


DRIVEN_LAGRANGIAN = """
lagcli: 1
coordinates: {s: {value: 1}}
particles: {a: {mass: 1, position: "[s + sin(t), s**2/2, 0]"}}
lagrangian: -a.x**2/2 - 3*a.y*a.vx/10
simulation: {duration: 3, samples: 301}
"""


@pytest.mark.parametrize("moves", ["sin(t)", "0"])
def test_a_lagrangian_of_particles_that_follow_coordinates(moves: str) -> None:
    """It acts on the particles: their carriers are part of R, and so of what is carried to the coordinates."""
    model = lagcli.loads(DRIVEN_LAGRANGIAN.replace("sin(t)", moves))
    run = lagcli.simulate(model)
    found = lagcli.audit(model, run)
    assert found.passed
    assert found.check("generalized").verdict == "pass"
    # What time does to the lagrangian through the particles is not known to the balance of energy.
    assert found.check("energy").verdict == ("not judged" if moves == "sin(t)" else "pass")
    rows = run.rows.copy()
    rows[:, run.columns.index("R.a.x")] *= 1.001
    assert lagcli.audit(model, with_rows(run, rows)).check("generalized").verdict == "fail"


def test_a_run_without_a_row_is_reported_as_such(command, tmp_path):
    file = tmp_path / "m.yaml"
    file.write_text(
        "lagcli: 1\nparticles:\n  a: {mass: 1, position: [1, 0, 0], velocity: [0, 1, 0]}\n"
        "  b: {mass: 1, position: [3, 0, 0], velocity: [0, 1, 0]}\n  c: {mass: 1, position: [0, 0, 0]}\n"
        "forces: {weight: {to: c, force: [0, 0, -1]}}\n"
        "holonomic:\n  left: norm(a) = 1\n  right: 'distance(b, [2, 0, 0]) = 1'\n  bar: distance(a, b) = 2\n"
        "inequality: {floor: c.z >= 0}\n",
        encoding="utf-8",
    )
    _, reason, code = command("simulate", file, "-q")
    assert code == 3
    out, err, code = command("audit", file)
    assert (out, code) == ("", 3)
    assert err == reason.rstrip() + "; there is no row to audit\n"
