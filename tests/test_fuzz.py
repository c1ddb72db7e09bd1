"""Texts and models nobody has written: an error or a model, a result or a refusal; and every result is right.

`LAGCLI_FUZZ_EXAMPLES=100000 python -m pytest tests/test_fuzz.py` looks at more examples than the thousand of every
run, `LAGCLI_FUZZ_SEED=7` at others.
"""

from __future__ import annotations

import contextlib
import dataclasses
import functools
import os
import signal
import tempfile
from collections.abc import Callable, Iterator
from typing import Any

import documents
import jets
import numpy as np
import pytest
import systems
from hypothesis import HealthCheck, Phase, configuration, event, given, seed, settings

import lagcli
from lagcli import catalogue, diagnostics, pipeline
from lagcli.expression import evaluate, facts, parser, tree
from lagcli.integrate import driver

# An interrupt of late algebra may land in a callback of the garbage collector set by hypothesis; it is repeated.
pytestmark = pytest.mark.filterwarnings("ignore::pytest.PytestUnraisableExceptionWarning")

EXAMPLES = int(os.environ.get("LAGCLI_FUZZ_EXAMPLES", "1000"))
SEED = os.environ.get("LAGCLI_FUZZ_SEED")
SECONDS = 20  # no example may take longer; most take a hundredth of a second
RUN_SECONDS = 1

# Tables of characters that hypothesis keeps belong to no checkout.
configuration.set_hypothesis_home_dir(os.path.join(tempfile.gettempdir(), "lagcli-hypothesis"))


def fuzz(share: float) -> Callable[[Callable[..., None]], Callable[..., None]]:
    """Settings of a fuzz test that takes this share of all examples."""
    chosen = settings(
        max_examples=max(1, round(share * EXAMPLES)),
        derandomize=SEED is None,
        database=None,
        deadline=None,
        report_multiple_bugs=False,
        phases=(Phase.generate, Phase.shrink),
        suppress_health_check=list(HealthCheck),
    )

    def decorated(test: Callable[..., None]) -> Callable[..., None]:
        return chosen(seed(int(SEED))(test) if SEED is not None else test)

    return decorated


class Hang(BaseException):
    """An example takes too long. No `Exception`, so that nothing takes it for an answer."""


@contextlib.contextmanager
def prompt(seconds: float = SECONDS) -> Iterator[None]:
    """Raises `Hang` where the body does not end in time, on systems that have an alarm."""
    if not hasattr(signal, "setitimer"):
        yield
        return

    def late(*_: object) -> None:
        raise Hang(f"no answer in {seconds} s")

    before = signal.signal(signal.SIGALRM, late)
    left, _ = signal.setitimer(signal.ITIMER_REAL, seconds)
    try:
        yield
    finally:
        signal.setitimer(signal.ITIMER_REAL, left)
        signal.signal(signal.SIGALRM, before)


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


@fuzz(0.79)
@given(documents.equations)
def test_an_expression_is_read_or_refused_at_its_spot(text: str) -> None:
    with prompt():
        try:
            node = parser.parse_equation(text)
        except tree.ExpressionError as error:
            assert_at_its_spot(error, text)
            return
        assert all(0 <= part.start <= part.end <= len(text) for part in tree.walk(node))
        with contextlib.suppress(tree.ExpressionError):
            evaluate.difference(node, facts.FactsAlgebra(_lookup, facts.DIFFERENTIAL, "a law", linear=True))


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


@fuzz(0.12)
@given(documents.documents() | documents.wild_models())
def test_a_document_is_a_model_or_located_errors(text: str) -> None:
    with prompt():
        try:
            model = lagcli.loads(text)
        except lagcli.ModelError as error:
            event(error.diagnostics[0].code)
            assert_well_said(error.diagnostics, text)
            return
        event("a model")
        assert_well_said(model.warnings, text)
        _answers(model, text)


def _answers(model: lagcli.Model, text: str) -> None:
    """What the three commands say of a model: results, located errors, or a stop with finite rows."""
    for command in (
        functools.partial(pipeline.count, limit=1.0),
        functools.partial(pipeline.check, limit=1.0),
    ):
        try:
            command(model)
        except lagcli.ModelError as error:
            assert_well_said(error.diagnostics, text)
    try:
        running = pipeline.Running(model, pipeline.run_settings(model, {"duration": 0.2, "samples": 5}))
    except lagcli.ModelError as error:
        event(error.diagnostics[0].code)
        assert_well_said(error.diagnostics, text)
        return
    try:
        with prompt(RUN_SECONDS):
            for block in running.blocks():
                assert np.isfinite(block).all()
    except driver.Stopped as stopped:
        event(stopped.stop.reason.partition(": ")[2])
    except Hang:
        # A motion may be as fast as it likes; what may not be is a run that takes no steps.
        event("slow")
        if running.stats.steps + running.stats.rejected < 100:
            raise


def test_a_valid_model_runs_and_lambda_and_reactions_are_those_of_its_equations() -> None:
    ran: list[bool] = []

    @fuzz(0.09)
    @given(systems.systems())
    def each(spec: jets.Spec) -> None:
        ran.append(runs_right(spec))

    each()
    assert sum(ran) >= 0.7 * len(ran) - 3


def runs_right(spec: jets.Spec) -> bool:
    """Whether a model ran; what it wrote is compared with its equations."""
    text = spec.text()
    with prompt():
        model = lagcli.loads(text)
        oracle = jets.Oracle(spec)
        try:
            running = pipeline.Running(
                model, pipeline.run_settings(model, {"duration": 0.2, "output_step": 0.01})
            )
        except lagcli.ModelError as error:
            refused = {diagnostic.code for diagnostic in error.diagnostics}
            event(min(refused))
            assert_well_said(error.diagnostics, text)
            # By construction nothing else is wrong with it: rows may be dependent, or too poorly independent.
            allowed = {"dependent-constraints", "no-coordinates", "indefinite-inertia"}
            assert refused <= allowed or _is_poor(oracle), text
            return False
        assert_counted(model, oracle)
        rows = []
        try:
            with prompt(RUN_SECONDS):
                for block in running.blocks():
                    rows.extend(block)
        except (driver.Stopped, Hang) as stopped:
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


def _named(running: pipeline.Running, row: jets.Floats) -> dict[str, float]:
    return dict(zip(running.columns, map(float, row), strict=True))


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


def assert_counted(model: lagcli.Model, oracle: jets.Oracle) -> None:
    """With holonomic rows alone, and these well independent at the start, the count is n - s."""
    count = pipeline.count(model, limit=1.0)
    report = pipeline.check(model, limit=1.0)
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
