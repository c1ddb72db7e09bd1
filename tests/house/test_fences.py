"""What the code may not do, and what it says about itself."""

import ast
import re
from collections.abc import Iterator
from pathlib import Path

from tests.helpers.parameter_objects import is_number, parameter_objects
from tests.house.test_architecture import FILES, PACKAGE, ROOT, imported, nodes, room, trees

MOST_ANY = 38  # it may be lowered: CasADi has stubs


def test_a_law_of_the_audit_has_its_name_alone() -> None:
    """The name of a check stands for one law: where it occurs twice it is of one numbered equation."""
    laws: dict[str, set[str]] = {}
    for name in FILES:
        for node in nodes(name):
            if isinstance(node, ast.Call) and ast.unparse(node.func).endswith("Law"):
                called, equation = (ast.literal_eval(argument) for argument in node.args[:2])
                laws.setdefault(called, set()).add(equation or f"{name}:{node.lineno}")
    assert len(laws) > 30
    assert {name: equations for name, equations in laws.items() if len(equations) > 1} == {}


def test_formulas_are_walked_and_not_searched_as_text() -> None:
    """What a model's expressions hold is asked of their trees."""
    rooms = "smoothness equations compiled linear contact start simulation statics analysis auditing linearization"
    searching = [name for name in FILES if name != "lagcli" and "re" in imported(name)]
    assert [name for name in searching if room(name) in rooms.split()] == []


def test_any_becomes_rarer() -> None:
    names = (node for name in FILES for node in nodes(name) if isinstance(node, ast.Name))
    assert sum(name.id == "Any" for name in names) <= MOST_ANY


def test_packages_say_what_goes_in_and_what_comes_out() -> None:
    for path in PACKAGE.glob("*/__init__.py"):
        text = ast.get_docstring(ast.parse(path.read_text(encoding="utf-8"))) or ""
        assert re.match(r".+\.\n\nIn: .+\nOut: .+\n", text), path.parent.name


def test_files_that_documents_name_are_there() -> None:
    named = re.compile(r"`([a-z_]+(?:/[a-z_0-9]+)+(?:\.py)?)`")
    for page in (ROOT / "CONTRIBUTING.md", ROOT / "docs" / "reference" / "glossary.md"):
        found = named.findall(page.read_text(encoding="utf-8"))
        assert len(found) > 10
        missing = [name for name in found if not any((folder / name).exists() for folder in places())]
        assert missing == []


def places() -> tuple[Path, ...]:
    return PACKAGE, ROOT, ROOT / "tests"


def bare_constants(text: str, tree: ast.Module) -> Iterator[str]:
    """The lines that give a number a name at the top of a module, with no comment above their block, none beside them
    and no docstring after them."""
    lines, body = text.splitlines(), tree.body
    for node, after in zip(body, [*body[1:], None], strict=True):
        if not isinstance(node, ast.Assign):
            continue
        if not all(map(is_number, node.value.elts if isinstance(node.value, ast.Tuple) else [node.value])):
            continue
        above = node.lineno - 2
        while above >= 0 and re.match(r"[A-Z_0-9, ]+ = ", lines[above]):
            above -= 1
        told = isinstance(after, ast.Expr) or "#" in "".join(lines[node.lineno - 1 : node.end_lineno])
        if not told and (above < 0 or not lines[above].startswith("#")):
            yield lines[node.lineno - 1]


def test_parameter_objects_are_frozen() -> None:
    """A class without slots, whose instance nothing can be set on; a dataclass would cost a start a hundred times."""
    for file, node in parameter_objects():
        assert ast.unparse(node.body[1]) == "__slots__ = ()", file


def test_a_constant_has_its_reason() -> None:
    text = "# Reason.\nA, B = 1, 2\nC = 3.0\n\nD = 4\n\nE = 5  # reason\nF = 2**3\n"
    assert list(bare_constants(text, ast.parse(text))) == ["D = 4", "F = 2**3"]
    found = [
        line
        for name, tree in trees().items()
        for line in bare_constants(FILES[name].read_text(encoding="utf-8"), tree)
    ]
    assert found == []
