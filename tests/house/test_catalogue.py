"""The pages of `lagcli explain`: every code has one, and every example gives what its page says."""

from __future__ import annotations

import ast
import pathlib
from collections.abc import Callable

import pytest

import lagcli
from lagcli import yaml_tree
from lagcli.errors import catalogue, diagnostics
from lagcli.errors.catalogue import Page
from lagcli.expression import facts
from lagcli.input import document
from lagcli.running import run_account, run_remarks
from lagcli.simulation.run_state import run_stop
from tests.house.test_architecture import FILES, nodes

PAGES = [page for code in catalogue.codes() if (page := catalogue.page(code)) is not None]
BALL = "lagcli: 1\nparticles:\n  a: {mass: 1, position: [1, 0, 0]}\n"


def _codes_in_source() -> set[str]:
    """Codes as the source gives them: first argument of an error or diagnostic, and the table of flags."""
    found = set()
    places = {
        "Diagnostic": 0,
        "ExpressionError": 0,
        "Fault": 0,
        "_refused": 0,
        "error": 0,
        "report": 1,
        "warn": 1,
        "_refuse": 1,
        "_report": 0,
    }
    for module in FILES:
        for node in nodes(module):
            if isinstance(node, ast.Call):
                name = getattr(node.func, "attr", getattr(node.func, "id", ""))
                index = places.get(name)
                if index is not None and len(node.args) > index:
                    found |= _words(node.args[index])
    stops = {
        run_stop.SINGULAR,
        run_stop.NO_SOLUTION,
        run_stop.NOT_FINITE,
        run_stop.TOO_SMALL,
        run_stop.CONTACT,
        run_stop.STICKS,
        run_account.INTERRUPTED,
        run_account.NOT_WRITTEN,
        run_remarks.CODE,
    }
    return found | stops | {code for code, _ in facts.FLAG_ERRORS.values()}


def _words(node: ast.AST) -> set[str]:
    """The texts in an expression that can be codes."""
    texts = [part.value for part in ast.walk(node) if isinstance(part, ast.Constant)]
    return {text for text in texts if isinstance(text, str) and text and " " not in text}


def _found(text: str, stage: str) -> list[diagnostics.Diagnostic]:
    """All errors and warnings that a model gives up to a stage."""
    try:
        model = document.read(text, "model.yaml")
        if stage == "read":
            return list(model.warnings)
        warnings = lagcli.check(model).warnings
        lagcli.simulate(model, duration=0.01, samples=2)
        return list(warnings)
    except diagnostics.ModelError as error:
        return list(error.diagnostics)


def test_every_code_that_the_source_gives_has_a_page() -> None:
    used = _codes_in_source()
    assert {"syntax", "unknown-name", "velocity-not-allowed", "bad-name", "dependent-constraints"} <= used
    assert used == set(catalogue.codes())


def test_codes_are_listed_once_in_order() -> None:
    assert list(catalogue.codes()) == sorted(set(catalogue.codes()))
    assert catalogue.page("no-such-code") is None


@pytest.mark.parametrize("page", [p for p in PAGES if p.stage not in ("input", "run")], ids=lambda p: p.code)
def test_an_example_gives_exactly_its_code_and_the_fix_removes_it(page: Page) -> None:
    found = _found(page.example, page.stage)
    assert {(d.code, d.severity) for d in found} == {(page.code, page.severity)}
    assert page.fixed != page.example
    assert _found(page.fixed, page.stage) == []


OF_RUNS = [page for page in PAGES if page.stage == "run"]


@pytest.mark.parametrize("page", [p for p in OF_RUNS if p.severity == "warning"], ids=lambda p: p.code)
def test_an_example_of_a_warning_of_a_run_gives_it_and_the_fix_removes_it(page: Page) -> None:
    assert _found(page.example, "start") == []
    run, fixed = (lagcli.simulate(lagcli.loads(text)) for text in (page.example, page.fixed))
    assert [warning.code for warning in run.stats.warnings] == [page.code]
    assert fixed.stats.warnings == ()


@pytest.mark.parametrize("page", [p for p in OF_RUNS if p.severity != "warning"], ids=lambda p: p.code)
def test_an_example_of_a_stop_stops_so_and_the_fix_lets_it_end(page: Page) -> None:
    assert _found(page.example, "start") == []
    with pytest.raises(lagcli.SimulationStopped) as caught:
        lagcli.simulate(lagcli.loads(page.example))
    assert caught.value.code == page.code
    assert caught.value.stats.stopped.reason == str(caught.value)
    assert lagcli.simulate(lagcli.loads(page.fixed)).stats.stopped is None


def _of_a_directory(where: pathlib.Path) -> None:
    yaml_tree.read(where)


def _of_a_large_file(where: pathlib.Path) -> None:
    yaml_tree.parse(b" " * (yaml_tree.MAX_BYTES + 1), "big.yaml")


def _of_binary(where: pathlib.Path) -> None:
    yaml_tree.parse(b"\x7fELF\x00\x01", "program")


def _of_a_long_expression(where: pathlib.Path) -> None:
    document.read(BALL + "outputs:\n  b: " + "a.x+" * 300_000 + "1\n", "long.yaml")


def _of_many_errors(where: pathlib.Path) -> None:
    lines = "".join(f"  b{i}: c{i}\n" for i in range(2 * diagnostics.MAX_ERRORS))
    document.read(BALL + "outputs:\n" + lines, "many.yaml")


def _of_another_law(where: pathlib.Path) -> None:
    text = "lagcli: 1\ncoordinates: {s: {value: 0}}\nparticles: {a: {mass: 1, position: [s, 0, 0]}}\n"
    document.read(text, "law.yaml", {"a.position": [1, 0, 0]})


def _of_long_equations(where: pathlib.Path) -> None:
    terms = " + ".join(f"{i}*x**{i % 9}" for i in range(1, 2500))
    lagcli.derive(
        document.read(f"lagcli: 1\ncoordinates: {{x: {{}}}}\nlagrangian: rate(x)**2 + {terms}\n", "long.yaml")
    )


def _of_many_links(folder: pathlib.Path) -> None:
    particles = 'p[i]: {for: "i = 1..200000", mass: 1, position: "[i, 0, 0]"}'
    lagcli.dof(lagcli.loads(f"lagcli: 1\nparticles:\n  {particles}\nholonomic:\n  rod: norm(p[1]) = 1\n"))


def _of_friction(where: pathlib.Path) -> None:
    text = BALL + "forces:\n  drag: {to: a, force: -v}\ndifferential:\n  row: a.vz = a.y*a.vx\n"
    lagcli.compare(lagcli.loads(text), vakonomic=True, duration=0.1)


def _of_a_differential_row(where: pathlib.Path) -> None:
    lagcli.limit(lagcli.loads(BALL + "differential:\n  row: a.vz = a.y*a.vx\n"), "row")


INPUTS: dict[str, Callable[[pathlib.Path], None]] = {
    "not-a-file": _of_a_directory,
    "too-large": _of_a_large_file,
    "not-text": _of_binary,
    "expression-too-long": _of_a_long_expression,
    "too-large-to-build": _of_many_links,
    "too-large-to-derive": _of_long_equations,
    "too-many-errors": _of_many_errors,
    "not-an-initial-value": _of_another_law,
    "not-of-an-action": _of_friction,
    "no-stiff-limit": _of_a_differential_row,
}


def test_every_page_of_an_input_is_tried_here() -> None:
    assert {p.code for p in PAGES if p.stage == "input" and p.severity != "stop"} == set(INPUTS)


@pytest.mark.parametrize("code", INPUTS)
def test_an_input_gives_the_code_of_its_page(code: str, tmp_path: pathlib.Path) -> None:
    with pytest.raises(diagnostics.ModelError) as caught:
        INPUTS[code](tmp_path)
    assert code in {d.code for d in caught.value.diagnostics}


@pytest.mark.parametrize("page", PAGES, ids=lambda p: p.code)
def test_a_page_is_plain_text_with_all_its_parts(page: Page) -> None:
    text = catalogue.render(page)
    assert text.startswith(f"{page.severity}[{page.code}]\n")
    for part in ("Why:", "Example:", "Fix:"):
        assert part in text
    assert all(line.strip() in text for line in page.example.splitlines())
    assert all(line in text for line in page.fixed_lines)
    assert text == text.rstrip()
