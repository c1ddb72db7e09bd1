"""Sizes and names of the house: what may not grow, and words that have one meaning.

A number here is what the code has today; it may be lowered, and is a debt where the comment says so.
"""

import ast
import re
from collections import Counter
from collections.abc import Iterator
from pathlib import Path

from tests.house.test_architecture import FILES, FLOORS, PACKAGE, ROOT, imported, nodes, room, trees

CLASS_LINES, CLASS_ATTRIBUTES = 300, 20
# Larger classes, with the lines and attributes they have: a debt.
LARGE: dict[str, tuple[int, int]] = {
    "lagcli.simulation.stepping.stepper.Stepper": (304, 21),
}

# Docstrings say what is returned or done; these open with a question word, a pronoun or a comparison: a debt.
QUESTIONS = re.compile(
    r"(What|Whether|Where|How|Which|Who|When|Why|Of|As|It|That|This|These|Those|The same)\b"
)
MOST_QUESTIONS = 0
MOST_ANY = 38  # a debt: CasADi has stubs


def classes() -> Iterator[tuple[str, ast.ClassDef]]:
    for name in FILES:
        for node in nodes(name):
            if isinstance(node, ast.ClassDef):
                yield name, node


def attributes(node: ast.ClassDef) -> set[str]:
    """The attributes that methods set on self."""
    return {
        each.attr
        for each in ast.walk(node)
        if isinstance(each, ast.Attribute)
        and isinstance(each.ctx, ast.Store)
        and isinstance(each.value, ast.Name)
        and each.value.id == "self"
    }


def test_classes_fit_a_head() -> None:
    large = {}
    for name, node in classes():
        assert node.end_lineno is not None
        size = node.end_lineno - node.lineno + 1, len(attributes(node))
        if size[0] > CLASS_LINES or size[1] > CLASS_ATTRIBUTES:
            large[f"{name}.{node.name}"] = size
    assert large.keys() <= LARGE.keys()
    for name, (lines, count) in large.items():
        assert lines <= LARGE[name][0], name
        assert count <= LARGE[name][1], name


def test_a_class_has_its_name_alone() -> None:
    names = Counter(node.name for _, node in classes())
    assert [name for name, count in names.items() if count > 1] == []


def test_a_file_has_its_name_alone() -> None:
    names = Counter(path.stem for path in FILES.values() if path.stem != "__init__")
    assert [name for name, count in names.items() if count > 1] == []


def test_a_law_of_the_audit_has_its_name_alone() -> None:
    """The name of a check stands for one law: where it occurs twice it is of one numbered equation."""
    laws: dict[str, set[str]] = {}
    for name in FILES:
        for node in nodes(name):
            if isinstance(node, ast.Call) and ast.unparse(node.func).endswith("CheckedLaw"):
                called, equation = (ast.literal_eval(argument) for argument in node.args[:2])
                laws.setdefault(called, set()).add(equation or f"{name}:{node.lineno}")
    assert len(laws) > 30
    assert {name: equations for name, equations in laws.items() if len(equations) > 1} == {}


def test_few_packages_and_few_modules_beside_them() -> None:
    packages = [path for path in PACKAGE.iterdir() if (path / "__init__.py").is_file()]
    modules = [path for path in PACKAGE.glob("*.py") if path.stem != "__init__"]
    assert len(packages) <= 21
    assert len(modules) <= 4
    assert len(FLOORS) <= 9


def test_formulas_are_walked_and_not_searched_as_text() -> None:
    """What a model's expressions hold is asked of their trees."""
    rooms = "smoothness equations compiled linear contact start simulation statics analysis auditing linearization"
    searching = [name for name in FILES if name != "lagcli" and "re" in imported(name)]
    assert [name for name in searching if room(name) in rooms.split()] == []


def test_docstrings_that_open_with_a_question_become_fewer() -> None:
    documented = (ast.FunctionDef, ast.ClassDef, ast.Module)
    texts = [
        ast.get_docstring(node) or ""
        for name in FILES
        for node in nodes(name)
        if isinstance(node, documented)
    ]
    assert sum(map(bool, map(QUESTIONS.match, texts))) <= MOST_QUESTIONS


# Words for which the field, or the glossary, has a term: index, point, location; enforced, fixed, independent; project;
# message; and coinages that nobody else has.
REPLACED = frozenset(
    "places held landing landed passage shaken spared untold jolt quest circuits mend cure unheld foreseen laid lay"
    " roll rolls sheet lone spelled spoken tower nearness clearance wishes tellings court".split()
)


def test_words_that_have_a_term_stay_away() -> None:
    names = {each for name in FILES for each in identifiers(name)}
    assert len(names) > 5000
    found = {each for each in names if REPLACED & set(re.findall(r"[a-z]+", each.replace("_", " ").lower()))}
    assert found == set()


def identifiers(name: str) -> Iterator[str]:
    """The names of functions, classes, arguments, variables and attributes in a file."""
    for node in nodes(name):
        if isinstance(node, ast.FunctionDef | ast.ClassDef):
            yield node.name
        elif isinstance(node, ast.arg):
            yield node.arg
        elif isinstance(node, ast.Name):
            yield node.id
        elif isinstance(node, ast.Attribute):
            yield node.attr


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


# Numbers that are no whole ones, of one module beside its parameter object: tolerances and the like are an algorithm's,
# and stand together. Modules with more are a debt.
MOST_LOOSE, MOST_WITH_MORE = 6, 1


def is_number(node: ast.expr) -> bool:
    """True for a number, an expression of numbers, and a tuple of such."""
    if isinstance(node, ast.UnaryOp):
        return is_number(node.operand)
    if isinstance(node, ast.BinOp):
        return is_number(node.left) and is_number(node.right)
    if isinstance(node, ast.Tuple):
        return bool(node.elts) and all(map(is_number, node.elts))
    return isinstance(node, ast.Constant) and type(node.value) in (int, float)


def bare_constants(text: str, tree: ast.Module) -> Iterator[str]:
    """The lines that give a number a name at the top of a module, with no comment above their block, none beside them
    and no docstring after them."""
    lines, body = text.splitlines(), tree.body
    for node, after in zip(body, [*body[1:], None], strict=True):
        if not isinstance(node, ast.Assign) or not is_number(node.value):
            continue
        above = node.lineno - 2
        while above >= 0 and re.match(r"[A-Z_0-9, ]+ = ", lines[above]):
            above -= 1
        told = isinstance(after, ast.Expr) or "#" in "".join(lines[node.lineno - 1 : node.end_lineno])
        if not told and (above < 0 or not lines[above].startswith("#")):
            yield lines[node.lineno - 1]


def loose_numbers(tree: ast.Module) -> int:
    """How many names for numbers that are no whole ones a module has at its top."""
    count = 0
    for node in tree.body:
        if isinstance(node, ast.Assign) and is_number(node.value):
            values = node.value.elts if isinstance(node.targets[0], ast.Tuple) else [node.value]  # type: ignore[attr-defined]
            count += sum("." in ast.unparse(value) or "e-" in ast.unparse(value) for value in values)
    return count


def test_numbers_of_an_algorithm_stand_in_its_parameter_object() -> None:
    assert loose_numbers(ast.parse("A, B = 1e-9, 2\nC = (0.5, 1.0)\nD = 2**53\n")) == 2
    more = [name for name, tree in trees().items() if loose_numbers(tree) > MOST_LOOSE]
    assert len(more) <= MOST_WITH_MORE, more


def parameter_objects() -> Iterator[tuple[Path, ast.ClassDef]]:
    for name, tree in trees().items():
        for node in tree.body:
            if isinstance(node, ast.Assign) and ast.unparse(node.targets[0]) == "PARAMETERS":
                called = ast.unparse(node.value).removesuffix("()")
                yield (
                    FILES[name],
                    next(c for c in tree.body if isinstance(c, ast.ClassDef) and c.name == called),
                )


def test_parameter_objects_are_frozen_and_every_field_says_its_reason() -> None:
    """A class without slots, whose instance nothing can be set on; a dataclass would cost a start a hundred times."""
    found = list(parameter_objects())
    assert len(found) > 10
    for path, node in found:
        assert node.name.endswith("Parameters"), path
        body = node.body[1:]
        assert ast.unparse(body[0]) == "__slots__ = ()", path
        for field, told in zip(body[1::2], body[2::2], strict=True):
            assert isinstance(field, ast.AnnAssign), f"{path}:{field.lineno}"
            assert isinstance(told, ast.Expr), f"{path}:{field.lineno}"


def test_a_constant_has_its_reason() -> None:
    text = "# Reason.\nA, B = 1, 2\nC = 3.0\n\nD = 4\n\nE = 5  # reason\nF = 2**3\n"
    assert list(bare_constants(text, ast.parse(text))) == ["D = 4", "F = 2**3"]
    found = [
        line
        for name, tree in trees().items()
        for line in bare_constants(FILES[name].read_text(encoding="utf-8"), tree)
    ]
    assert found == []


def test_tests_that_parameters_name_are_there() -> None:
    """The field of a parameter object names the test that fails where it moves."""
    tests = "\n".join(path.read_text(encoding="utf-8") for path in (ROOT / "tests").rglob("test_*.py"))
    named: set[str] = set()
    for path, _ in parameter_objects():
        named |= set(re.findall(r"`(test_\w+)`", path.read_text(encoding="utf-8")))
    assert named
    assert [name for name in named if f"def {name}(" not in tests] == []
