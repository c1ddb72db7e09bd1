"""Texts, models and checkpoints nobody has written: an answer or a refusal; and every answer is right.

Of every thousand examples most are expressions, and some documents, whole models and checkpoints. More than the
thousand of every run are looked at in parts of a thousand, each the same for the same seed:

    LAGCLI_FUZZ_EXAMPLES=100000 python -m pytest tests/fuzz/test_fuzz.py -vv
    LAGCLI_FUZZ_EXAMPLES=100000 LAGCLI_FUZZ_SEED=7 LAGCLI_FUZZ_PARTS=21-40 python -m pytest tests/fuzz/test_fuzz.py -vv

An example that takes too long is a failure that names it. One that does not even let Python go on ends the process,
and stands with the stack in `LAST`.
"""

from __future__ import annotations

import contextlib
import dataclasses
import faulthandler
import functools
import os
import signal
import tempfile
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import HealthCheck, Phase, configuration, event, given, seed, settings
from hypothesis import strategies as st

import lagcli
from lagcli.api import prepare_run, run_settings
from lagcli.errors import catalogue, diagnostics
from lagcli.expression import evaluate, facts, integers, parser, tree
from lagcli.running import simulation_run
from lagcli.simulation.run_state import checkpoint, run_stop
from tests.helpers import documents, jets, systems

# An interrupt of late algebra may land in a callback of the garbage collector set by hypothesis; it is repeated.
pytestmark = pytest.mark.filterwarnings("ignore::pytest.PytestUnraisableExceptionWarning")

EXAMPLES = int(os.environ.get("LAGCLI_FUZZ_EXAMPLES", "1000"))
SEED = int(os.environ.get("LAGCLI_FUZZ_SEED", "0"))
PART = 1000
SECONDS = 60  # of processor time: most examples take a hundredth, some look for a start in vain for 6
RUN_SECONDS = 1
PATIENCE = 300  # seconds of the clock

HOME = os.path.join(tempfile.gettempdir(), "lagcli-hypothesis")
LAST = os.path.join(HOME, f"example-{os.getpid()}.txt")
# Tables of characters that hypothesis keeps belong to no checkout.
configuration.set_hypothesis_home_dir(HOME)


def chosen_parts() -> list[int]:
    """The parts this process looks at, counted from 1."""
    count = -(-EXAMPLES // PART)
    first, _, last = os.environ.get("LAGCLI_FUZZ_PARTS", f"1-{count}").partition("-")
    return [part for part in range(int(first), int(last or first) + 1) if 1 <= part <= count]


every_part = pytest.mark.parametrize("part", chosen_parts())


def look(part: int, share: float, strategy: st.SearchStrategy[Any], judge: Callable[[Any], object]) -> None:
    """Judge the examples of a part, of which there is this share for the test."""
    size = min(PART, EXAMPLES - (part - 1) * PART)

    @seed(SEED * 1_000_000 + part)
    @settings(
        max_examples=max(1, round(share * size)),
        database=None,
        deadline=None,
        report_multiple_bugs=False,
        phases=(Phase.generate, Phase.shrink),
        suppress_health_check=list(HealthCheck),
    )
    @given(strategy)
    def each(example: Any) -> None:
        with watched(example), prompt():
            judge(example)

    each()


class Hang(BaseException):
    """An example takes too long. No `Exception`, so that nothing takes it for an answer."""


@contextlib.contextmanager
def watched(example: Any) -> Iterator[None]:
    """Names the example that fails or hangs: in the error, or in the file `LAST` where the process has to be ended."""
    text = example.text() if isinstance(example, jets.Spec) else str(example)
    os.makedirs(HOME, exist_ok=True)
    with open(LAST, "w", encoding="utf-8", errors="backslashreplace") as file:
        file.write(text + "\n")
        file.flush()
        faulthandler.dump_traceback_later(PATIENCE, exit=True, file=file)
        try:
            yield
        except Hang as hang:
            raise Hang(f"{hang}:\n{text}") from None
        except Exception as error:
            error.add_note(text)
            raise
        finally:
            faulthandler.cancel_dump_traceback_later()
    os.remove(LAST)


@contextlib.contextmanager
def prompt(seconds: float = SECONDS) -> Iterator[None]:
    """Raises `Hang` where the body takes more processor time, on systems that can tell."""
    if not hasattr(signal, "setitimer"):
        yield
        return

    def late(*_: object) -> None:
        raise Hang(f"no answer in {seconds} s")

    before = signal.signal(signal.SIGPROF, late)
    left, _ = signal.setitimer(signal.ITIMER_PROF, seconds)
    try:
        yield
    finally:
        signal.setitimer(signal.ITIMER_PROF, left)
        signal.signal(signal.SIGPROF, before)


def assert_well_said(found: tuple[diagnostics.Diagnostic, ...], text: str) -> None:
    """Every diagnostic has a page and stands inside the text."""
    lines = len(text.splitlines()) + 1
    for diagnostic in found:
        at = diagnostic.location
        assert catalogue.page(diagnostic.code) is not None, diagnostic
        assert 1 <= at.line <= lines, diagnostic
        assert at.column >= 1, diagnostic
        assert at.length >= 1, diagnostic
        assert not at.source_line or at.column <= len(at.source_line) + 1, diagnostic
        assert diagnostic.message, diagnostic
        shown = diagnostic.render()
        assert all(c.isprintable() or c == "\n" for c in shown), diagnostic
        assert len(shown) < 2500, diagnostic


@every_part
def test_an_expression_is_read_or_refused_at_its_spot(part: int) -> None:
    look(part, 0.7, documents.equations, reads_an_equation)


def reads_an_equation(text: str) -> None:
    node = read_or_refused(parser.parse_equation, text)
    if node is not None:
        with contextlib.suppress(tree.ExpressionError):
            evaluate.difference(node, facts.FactsAlgebra(_lookup, facts.DIFFERENTIAL, "a law", linear=True))


@every_part
def test_a_condition_and_an_event_are_read_or_refused_at_their_spot(part: int) -> None:
    look(part, 0.05, documents.one_sided, reads_a_condition)


def reads_a_condition(text: str) -> None:
    read_or_refused(parser.parse_crossing, text)
    node = read_or_refused(parser.parse_condition, text)
    if node is not None:
        assert node.relation == ">="
        with contextlib.suppress(tree.ExpressionError):
            evaluate.difference(node, facts.FactsAlgebra(_lookup, facts.POSITION, "a condition"))


def read_or_refused(read: Callable[[str], Any], text: str) -> Any:
    """What is read, whose parts lie in the text; None for a refusal that points into it."""
    try:
        node = read(text)
    except tree.ExpressionError as error:
        assert_at_its_spot(error, text)
        return None
    parts = (node.low, node.high) if isinstance(node, tree.Range) else (node,)
    assert all(0 <= p.start <= p.end <= len(text) for part in parts for p in tree.walk(part))
    return node


def assert_at_its_spot(error: tree.ExpressionError, text: str) -> None:
    assert 0 <= error.start <= error.end
    assert error.start <= len(text)
    assert catalogue.page(error.code) is not None


def _lookup(node: tree.Node) -> Any:
    if isinstance(node, tree.Call):
        return facts.Facts(None, frozenset(("velocity",)), 1, 1)
    name = getattr(node, "name", getattr(node, "owner", ""))
    if name in ("n3", "a", "r"):
        return (facts.Facts(1.5) if name == "n3" else facts.Facts(None, facts.POSITION),) * 3
    return facts.Facts(None, facts.POSITION) if name in ("q", "t") else facts.Facts(2.0)


# Index variables over three members, and a parameter.
INDICES: dict[str, Any] = {"i": np.array([-1, 0, 2]), "j": np.array([5, 1, -3]), "N": 3.0, "k": 2.5}


def _of_index(node: tree.Name) -> Any:
    if node.name not in INDICES:
        raise tree.ExpressionError("unknown-name", "", node.start, node.end)
    return INDICES[node.name]


@every_part
def test_ranges_filters_and_references_are_read_or_refused_at_their_spot(part: int) -> None:
    kinds = {"range": documents.ranges, "filter": documents.filters, "reference": documents.references}
    look(
        part,
        0.05,
        st.one_of(*(st.tuples(st.just(kind), texts) for kind, texts in kinds.items())),
        reads_of_families,
    )


def reads_of_families(example: tuple[str, str]) -> None:
    kind, text = example
    node = read_or_refused(getattr(parser, f"parse_{kind}"), text)
    try:
        match node:
            case tree.Range():
                for bound in (node.low, node.high):
                    assert (np.abs(integers.evaluate(bound, _of_index)) <= integers.LIMIT).all()
            case tree.Index():
                for index in node.indices:
                    assert (np.abs(integers.evaluate(index, _of_index)) <= integers.LIMIT).all()
            case tree.Name() | None:
                pass
            case _:
                assert np.asarray(integers.holds(node, _of_index)).dtype == bool
    except tree.ExpressionError as error:
        assert_at_its_spot(error, text)


@every_part
def test_integer_expressions_and_filters_have_the_values_of_fractions(part: int) -> None:
    look(part, 0.05, st.tuples(documents.wholes, documents.conditions), computes_as_fractions)


def computes_as_fractions(example: tuple[str, str]) -> None:
    for text, read, compute in zip(
        example, (parser.parse, parser.parse_filter), (integers.evaluate, integers.holds), strict=True
    ):
        try:
            found = np.broadcast_to(compute(read(text), _of_index), 3).tolist()
        except tree.ExpressionError as error:
            assert_at_its_spot(error, text)
            assert "/" in text or "**" in text, text  # elsewhere there is nothing to refuse
            continue
        for member, value in enumerate(found):
            numbers = {name: int(np.broadcast_to(INDICES[name], 3)[member]) for name in "ijN"}
            assert jets.exact(text, numbers) == value, text


@every_part
def test_a_document_is_a_model_or_located_errors(part: int) -> None:
    look(part, 0.07, documents.documents(), answers_or_refuses)


@every_part
def test_a_model_with_hostile_formulas_is_answered_or_refused(part: int) -> None:
    look(part, 0.02, documents.wild_models() | documents.wild_families(), answers_or_refuses)


@every_part
def test_a_model_with_hostile_inequalities_and_events_is_answered_or_refused(part: int) -> None:
    look(part, 0.01, documents.wild_one_sided, answers_or_refuses)


def answers_or_refuses(text: str) -> None:
    try:
        model = lagcli.loads(text)
    except lagcli.ModelError as error:
        event(error.diagnostics[0].code)
        assert_well_said(error.diagnostics, text)
        return
    event("a model")
    assert_well_said(model.warnings, text)
    _answers(model, text)


FOUND = (
    # The rows overflow when they are squared.
    """{"lagcli": 1, "coordinates": {"q": {"value": 0.5, "rate": 1}, "h": {}}, "lagrangian": "rate(q)**2 + rate(h)**2",
    "particles": {"a": {"mass": 1, "position": [1, 0, 0]}}, "simulation": {"assemble": "true"},
    "holonomic": {"rod": "q*1e308*norm(a - [h, 0, 1]) = norm(a - [1, 0, 1])"},
    "differential": {"roll": "norm(a - [q, 0, 1])*rate(a.x) - norm(a - [a.y, 0, 1])*rate(q)"}}""",
    # A body as large as numbers, and one of which a particle starts at a pole.
    """{"lagcli": 1, "particles": {"a": {"mass": 1, "position": [1e308, 0, 0]},
    "b": {"mass": 1, "position": [-1e308, 1, 0]}}, "rigid": {"body": ["a", "b"]}}""",
    """{"lagcli": 1, "coordinates": {"q": {}}, "particles": {"a": {"mass": 1, "position": ["1/q", 0, 0]},
    "b": {"mass": 1, "position": [0, 1, 0]}}, "rigid": {"body": ["a", "b"]}}""",
    # A term without a differential that is another number in each member; a family beside what is none.
    """{"lagcli": 1, "particles": {"p[i]": {"for": "i = 1..2", "mass": 1, "position": "[i, 0, 0]"}},
    "differential": {"w[i]": {"for": "i = 1..2", "equation": "d(p[i].x) - i"}}}""",
    """{"lagcli": 1, "parameters": {"c": 1}, "particles": {
    "c[i]": {"for": "i = 1..2", "mass": 1, "position": "[i, 0, 0]"}}}""",
    # More rows than coordinates, of which there is one.
    """{"lagcli": 1, "coordinates": {"q": {}}, "lagrangian": "rate(q)**2/2",
    "differential": {"w0": "d(q) + q*dt", "w1": "d(q) + q*dt"}}""",
    # A mapping in the place of an equation.
    """{"lagcli": 1, "particles": {"a": {"mass": 1, "position": [1, 0, 0]}}, "holonomic": {"h": {"equation": {}}},
    "differential": {"w": {"equation": {}}}, "outputs": {"o": {"expression": {}}}}""",
)


@pytest.mark.parametrize("text", FOUND)
def test_what_was_once_a_crash_is_answered_or_refused(text: str) -> None:
    look(1, 0.0, st.just(text), answers_or_refuses)


def _answers(model: lagcli.Model, text: str) -> None:
    """What the three commands say of a model: results, located errors, or a stop with finite rows."""
    for command in (
        functools.partial(lagcli.dof, limit=1.0),
        functools.partial(lagcli.check, limit=1.0),
    ):
        try:
            command(model)
        except lagcli.ModelError as error:
            assert_well_said(error.diagnostics, text)
    try:
        running = prepare_run.start(model, run_settings.chosen(model, {"duration": 0.2, "samples": 5}))
    except lagcli.ModelError as error:
        event(error.diagnostics[0].code)
        assert_well_said(error.diagnostics, text)
        return
    _rows(running)


def _rows(running: simulation_run.SimulationRun) -> jets.Floats:
    """The rows of a run up to its end, its stop, or the end of patience; all finite."""
    blocks = [np.zeros((0, len(running.columns)))]
    try:
        with prompt(RUN_SECONDS):
            for block in running.blocks():
                assert np.isfinite(block).all()
                blocks.append(block)
    except run_stop.RunStop as stopped:
        event(stopped.stop.reason.partition(": ")[2])
    except Hang:
        # A motion may be as fast as it likes; what may not be is a run that takes no steps.
        event("slow")
        if running.stats.steps + running.stats.rejected < 100:
            raise
    return np.concatenate(blocks)


CHAIN = """\
lagcli: 1
parameters: {N: 3, w: 2}
particles:
  p[i]: {for: "i = 1..N", mass: 1, position: "[i, 0, 0]", velocity: "[0, i, -1]"}
  bead: {mass: 0.5, position: [1, 0, 0], velocity: [0, w, 0]}
forces:
  weight: {to: all, force: [0, 0, "-9.81*m"]}
holonomic:
  hook: norm(p[1]) = 1
  link[i]: {for: "i = 2..N", equation: "distance(p[i-1], p[i]) = 1"}
  spoke: bead.x*sin(w*t) = bead.y*cos(w*t)
"""
SLEIGH = """\
lagcli: 1
parameters: {slope: 0.4, push: [1, 2, 3]}
coordinates: {x: {rate: 1}, y: {}, theta: {rate: 0.7}}
lagrangian: (rate(x)**2 + rate(y)**2 + rate(theta)**2)/2 - 9.81*sin(slope)*x
differential: {edge: sin(theta)*d(x) - cos(theta)*d(y) = 0}
"""
RUNS = {"chain": CHAIN, "sleigh": SLEIGH}


def _going(name: str, duration: float, resumed: Path | None = None) -> simulation_run.SimulationRun:
    model = lagcli.loads(RUNS[name])
    return prepare_run.prepare(
        model, run_settings.chosen(model, {"duration": duration, "output_step": 0.03}), resumed
    )


@functools.cache
def _cut(name: str) -> bytes:
    """The checkpoint of a run that goes on."""
    running = _going(name, 0.1)
    _rows(running)
    return checkpoint.encoded(running.checkpoint())


@functools.cache
def _rest(name: str) -> bytes:
    """Its rows from there, of a run that was never cut."""
    rows = _rows(_going(name, 0.3))
    return rows[rows[:, 0] > 0.1].tobytes()


@every_part
def test_a_checkpoint_is_gone_on_from_rightly_or_refused(part: int, tmp_path: Path) -> None:
    def goes_on_or_refuses(example: tuple[str, bytes]) -> None:
        name, data = example
        (tmp_path / "run.json").write_bytes(data)
        refusal = ""
        try:
            running = _going(name, 0.3, tmp_path / "run.json")
        except ValueError as error:
            refusal = str(error)
        if refusal:
            event(refusal.partition(": ")[2])
            assert refusal.startswith(str(tmp_path / "run.json"))
            return
        rows = _rows(running)
        point, original = checkpoint.decoded(data), checkpoint.decoded(_cut(name))
        is_same = checkpoint.encoded(point) == checkpoint.encoded(original)
        event("goes on" if is_same else "goes on from another state")
        if is_same:
            assert rows.tobytes() == _rest(name)

    look(part, 0.02, documents.checkpoints(_cut, tuple(RUNS), checkpoint.control_sum), goes_on_or_refuses)


@every_part
def test_a_valid_model_runs_and_lambda_and_reactions_are_those_of_its_equations(part: int) -> None:
    ran: list[bool] = []
    look(part, 0.04, systems.systems() | systems.families(), lambda spec: ran.append(runs_right(spec)))
    assert sum(ran) >= 0.7 * len(ran) - 3


def runs_right(spec: jets.Spec) -> bool:
    """Whether a model ran; what it wrote is compared with its equations."""
    text = spec.text()
    model = lagcli.loads(text)
    oracle = jets.Oracle(spec)
    try:
        running = prepare_run.start(model, run_settings.chosen(model, {"duration": 0.2, "output_step": 0.01}))
    except lagcli.ModelError as error:
        refused = {diagnostic.code for diagnostic in error.diagnostics}
        event(min(refused))
        assert_well_said(error.diagnostics, text)
        # By construction nothing else is wrong with it: rows may be dependent, or too poorly independent.
        allowed = {"dependent-constraints", "no-coordinates", "indefinite-inertia"}
        assert refused <= allowed or _is_poor(oracle) or _has_pole(oracle), text
        return False
    assert_counted(model, oracle)
    rows = []
    try:
        with prompt(RUN_SECONDS):
            for block in running.blocks():
                rows.extend(block)
    except (run_stop.RunStop, Hang) as stopped:
        event(type(stopped).__name__)
    event("compared")
    assert np.isfinite(rows).all()
    stats = running.stats
    assert stats.position_drift <= 1e-9 * (1 + np.abs(rows).max(initial=0.0)), text
    speeds = [i for i, name in enumerate(running.columns) if name.partition(".")[2] in ("vx", "vy", "vz")]
    if np.abs(np.array(rows)[:, speeds]).max(initial=0.0) > 0.1:
        # Where no particle moves the balance is a ratio of roundings.
        assert stats.energy_imbalance <= 1e-6, text
    states = [_state(spec, _named(running, row)) for row in rows[:2] + rows[-1:]]
    found = [assert_row(oracle, state) for state in states]
    if len(rows) > 2:
        assert_motion(states[0], states[1], found[0], found[1])
    return True


def _named(running: simulation_run.SimulationRun, row: jets.Floats) -> dict[str, float]:
    """The values of a row by column, members of families under the names that the equations have for them."""
    return dict(zip(map(jets.flat_name, running.columns), map(float, row), strict=True))


@dataclasses.dataclass(frozen=True)
class State:
    """One row of a table by name, with t, q and v taken out of it."""

    row: dict[str, float]
    t: float
    q: jets.Floats
    v: jets.Floats


def _state(spec: jets.Spec, row: dict[str, float]) -> State:
    free = [p for p in spec.particles if p in spec.free]
    q = [row[f"{p}.{axis}"] for p in free for axis in "xyz"] + [row[name] for name in spec.coordinates]
    v = [row[f"{p}.v{axis}"] for p in free for axis in "xyz"] + [row[f"rate({c})"] for c in spec.coordinates]
    return State(row, row["t"], np.array(q), np.array(v))


def _condition(B: jets.Floats) -> float:
    """How badly the rows are independent, each taken at length one."""
    if not B.size:
        return 1.0
    lengths = np.linalg.norm(B, axis=1)
    # Where a gradient nearly vanishes its own rounding is all that is left of it.
    if lengths.min() < 1e-6 or len(B) > B.shape[1]:
        return np.inf
    return float(np.linalg.cond(B / lengths[:, None]))


def _is_poor(oracle: jets.Oracle) -> bool:
    q, v = oracle.spec.start()
    return not _condition(oracle.constraints(0.0, q, v)[0]) < 1e4


def _has_pole(oracle: jets.Oracle) -> bool:
    """Whether forces or reactions are not finite at the start: two particles stand at one place."""
    q, v = oracle.spec.start()
    found = [oracle.equations(0.0, q, v).h]
    found += [oracle.reaction(p, 0.0, q, v, 0.0 * q) for p in oracle.spec.dependent]
    return not np.isfinite(np.concatenate(found)).all()


def assert_counted(model: lagcli.Model, oracle: jets.Oracle) -> None:
    """With holonomic rows alone, and these well independent at the start, the count is n - s."""
    count = lagcli.dof(model, limit=1.0)
    report = lagcli.check(model, limit=1.0)
    q, v = oracle.spec.start()
    equations = oracle.equations(0.0, q, v)
    if not oracle.spec.differential and not _is_poor(oracle):
        assert count.configuration_dof in (oracle.n - len(equations.f), None)
        assert report.dof.configuration_dof == count.configuration_dof
        assert report.initial.consistent
    if count.configuration_dof is None:
        event("undecided")


def assert_row(oracle: jets.Oracle, state: State) -> jets.Floats:
    """lambda, R, energy and outputs of a row are those of the equations at its state; the acceleration there."""
    spec, row = oracle.spec, state.row
    equations = oracle.equations(state.t, state.q, state.v)
    a, lam = equations.solved()
    condition = _condition(equations.B) ** 2 * np.linalg.cond(equations.M)
    if not condition < 1e7:
        event("poorly conditioned")
        return a
    near = functools.partial(np.testing.assert_allclose, rtol=1e-11 * condition)
    table = np.array([value for name, value in row.items() if name.startswith("lambda.")])
    R = equations.B.T @ lam
    size = np.abs(equations.h).max(initial=1.0) + np.abs(equations.M @ a).max(initial=0.0)
    loose = 1e-10 * condition
    parts = np.linalg.norm(equations.B, axis=1) if len(lam) else np.ones(0)
    near(table * parts, lam * parts, atol=loose * size)
    free = [p for p in spec.particles if p in spec.free]
    names = [f"R.{p}.{axis}" for p in free for axis in "xyz"] + [f"R.{name}" for name in spec.coordinates]
    near([row[name] for name in names], R, atol=loose * size)
    for p in spec.dependent:
        expected = oracle.reaction(p, state.t, state.q, state.v, a)
        near([row[f"R.{p}.{axis}"] for axis in "xyz"], expected, atol=loose * (size + np.abs(expected).max()))
    near(row["energy"], equations.energy, atol=1e-9 * (abs(equations.kinetic) + abs(equations.potential) + 1))
    residual = equations.B @ state.v + equations.b
    near(residual / parts, 0 * parts, atol=1e-9 * (1 + np.abs(state.v).max(initial=0.0)))
    near(equations.f / parts[: len(equations.f)], 0.0, atol=1e-9 * (1 + np.abs(state.q).max(initial=0.0)))
    for name, text in spec.outputs.items():
        expected = jets.numbers(jets.evaluate(text, oracle.names(state.t, state.q, state.v)))
        columns = [name] if len(expected) == 1 else [f"{name}.{axis}" for axis in "xyz"]
        near([row[column] for column in columns], expected, rtol=1e-9, atol=1e-12)
    return a


def assert_motion(first: State, second: State, a: jets.Floats, b: jets.Floats) -> None:
    """Between two rows the state moves as its velocities and accelerations say (Hermite's rule, to h**5, h**3)."""
    h = second.t - first.t
    fast = np.abs(first.v).max() + h * np.abs([a, b]).max()  # the scale of a velocity
    turn = np.abs(a - b).max()
    if turn > 0.2 * np.abs([a, b]).max():
        event("too fast to compare rows")
        return
    expected = first.q + h / 2 * (first.v + second.v) + h * h / 12 * (a - b)
    np.testing.assert_allclose(
        second.q, expected, rtol=1e-9, atol=1e-2 * h * h * turn + 1e-9 * h * (1 + fast)
    )
