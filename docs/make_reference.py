"""Writes the generated parts of docs/reference from the tables of the code: `python docs/make_reference.py`.

A part stands between `<!-- generated: NAME -->` and `<!-- end -->`; the text around it is written by hand.
"""

from __future__ import annotations

import ast
import json
import math
import pathlib
import re
import sys
import textwrap
from collections.abc import Callable, Iterator, Mapping

from lagcli.errors import catalogue
from lagcli.expression import evaluate, functions
from lagcli.input import format_schema, keys, namespace

ROOT = pathlib.Path(__file__).parent.parent
HERE = ROOT / "docs" / "reference"
PART = re.compile(r"(<!-- generated: (\w+) -->\n).*?(<!-- end -->)", re.DOTALL)


def key_table() -> str:
    """Every key of the format, one line each, with its path."""
    lines = ["| key | holds | meaning | default |", "| --- | --- | --- | --- |"]
    for path, key in _walk(keys.FORMAT, ""):
        notes = ["required"] if key.required else []
        meaning = key.meaning + (f" ({', '.join(notes)})" if notes else "")
        default = f"`{key.default}`" if key.default else ""
        lines.append(f"| `{path}` | {key.holds} | {meaning} | {default} |")
    return "\n".join(lines)


def _walk(parent: keys.Key, prefix: str) -> Iterator[tuple[str, keys.Key]]:
    for key in parent.keys:
        path = prefix + key.name
        yield (f"{path}.NAME" if key.entries else path), key
        yield from _walk(key, f"{path}.NAME." if key.entries else f"{path}.")


def reserved_names() -> str:
    """Names that may not be taken."""
    everywhere, columns = _listed(namespace.RESERVED), _listed(namespace.NOT_FOR_COLUMNS)
    return (
        f"Reserved everywhere: {everywhere}. Particles, coordinates and outputs may not be called {columns}."
    )


def function_table() -> str:
    """The functions of expressions, by what they take."""
    one, two, many = (
        [row.name for row in functions.ROWS if row.arguments == n] for n in (1, 2, functions.MANY)
    )
    vectors = [f"{name}({', '.join('uw'[:count])})" for name, count in evaluate.VECTOR_FUNCTIONS.items()]
    rows = [
        ("a scalar", _listed(one)),
        ("two scalars", _listed(two)),
        ("two or more scalars", _listed(many)),
        ("vectors", _listed(vectors)),
    ]
    return "\n".join(["| of | functions |", "| --- | --- |", *(f"| {of} | {names} |" for of, names in rows)])


def error_pages() -> str:
    """The catalogue of messages, one heading each."""
    return "\n\n".join(_error_page(code) for code in catalogue.codes())


def _error_page(code: str) -> str:
    page = catalogue.page(code)
    assert page is not None, code
    example = page.example.rstrip() or "(an empty file)"
    fix = [page.fix] + ([_indented("\n".join(page.fixed_lines))] if page.fixed_lines else [])
    head = f"## {code}" if page.severity == "error" else f"## {code} ({page.severity})"
    return "\n\n".join([head, f"{page.meaning} {page.why}", _indented(example), *fix])


def equation_table() -> str:
    """The equations that pages and outputs refer to."""
    rows = [f"| (D.{n}) | {line} |" for n, line in sorted(catalogue.LINES.items())]
    return "\n".join([catalogue.TEXT, "", "| number | says |", "| --- | --- |", *rows])


def published_table() -> str:
    """Numbers of other programs beside ours, and where they come from."""
    cases = json.loads((ROOT / "tests" / "reference" / "published.json").read_text(encoding="utf-8"))
    rows = ["| case | quantity | published | lagcli | agree |", "| --- | --- | --- | --- | --- |"]
    sources = ["| case | source |", "| --- | --- |"]
    for case in cases:
        folder = "" if case["model"].startswith("models/") else "tests/reference/peers/"
        path = f"../../{folder}{case['model']}"
        for number, row in enumerate(case["rows"]):
            name = "" if number else f"[{case['id']}]({path})"
            rows.append(
                f"| {name} | {row['quantity']} | {row['published']} | {row['lagcli']} | {agreement(row)} |"
            )
        sources.append(f"| {case['id']} | {case['source']} |")
    return "\n".join([*rows, "", *sources])


def agreement(row: Mapping[str, str]) -> str:
    """Digits in which two numbers agree, of the ones that are printed; or their difference."""
    published, ours = float(row["published"]), float(row["lagcli"])
    difference = abs(published - ours)
    if row.get("bound"):
        return "within it"
    if row.get("largest"):
        return "zero to rounding"
    if row.get("off"):
        return f"off by {difference:.1e}"
    printed = min(
        len(text.lstrip("-0.").replace(".", "")) for text in (row["published"], f"{ours:.10e}"[:-4])
    )
    if not difference:
        return "exact" if printed < 10 else f"{printed} digits"
    return f"{min(printed, math.floor(-math.log10(difference / abs(published))))} digits"


def package_table() -> str:
    """The packages, from their docstrings: first line, `In:` and `Out:`."""
    rows = []
    for path in sorted((ROOT / "lagcli").glob("*/__init__.py")):
        text = ast.get_docstring(ast.parse(path.read_text(encoding="utf-8"))) or ""
        first, takes, gives = re.match(r"(.*)\n\nIn: (.*)\nOut: (.*)", text).groups()  # type: ignore[union-attr]
        rows.append(f"| `{path.parent.name}` | {first} | {takes} | {gives} |")
    return "\n".join(["| package | holds | in | out |", "| --- | --- | --- | --- |", *rows])


def floor_list() -> str:
    """The packages, and the modules beside them, each above all that it imports."""
    graph: dict[str, set[str]] = {}
    for path in (ROOT / "lagcli").rglob("*.py"):
        name = path.relative_to(ROOT / "lagcli").parts[0].removesuffix(".py")
        if name != "__init__":
            graph.setdefault(name, set()).update(_imported(path) - {name})
    floors: list[set[str]] = []
    while left := graph.keys() - set().union(*floors):
        lowest = {name for name in left if not graph[name] & left}
        assert lowest, f"a circle among {sorted(left)}"
        floors.append(lowest)
    first = f"They lie on {len(floors)} floors, computed from the imports: each above all that it imports."
    return "\n".join([first, "", *(f"{n}. {_listed(sorted(names))}" for n, names in enumerate(floors, 1))])


def _imported(path: pathlib.Path) -> set[str]:
    """The packages of lagcli, and the modules beside them, that a file imports anywhere."""
    found: set[str] = set()
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.ImportFrom) and node.module == "lagcli":
            found |= {alias.name for alias in node.names if alias.name != "__version__"}
        elif isinstance(node, ast.ImportFrom | ast.Import):
            names = [node.module or ""] if isinstance(node, ast.ImportFrom) else [a.name for a in node.names]
            found |= {name.split(".")[1] for name in names if name.startswith("lagcli.")}
    return found


def _indented(text: str) -> str:
    return textwrap.indent(text, "    ")


def _listed(names: tuple[str, ...] | list[str]) -> str:
    return ", ".join(f"`{name}`" for name in names)


PARTS: dict[str, Callable[[], str]] = {
    "keys": key_table,
    "names": reserved_names,
    "functions": function_table,
    "errors": error_pages,
    "equations": equation_table,
    "packages": package_table,
    "floors": floor_list,
    "published": published_table,
}


def pages() -> Iterator[pathlib.Path]:
    """The pages that hold generated parts."""
    for page in (*sorted(HERE.glob("*.md")), ROOT / "CONTRIBUTING.md"):
        if PART.search(page.read_text(encoding="utf-8")):
            yield page


def made(text: str) -> str:
    """The text of a page with its parts made anew."""
    return PART.sub(lambda match: f"{match[1]}{PARTS[match[2]]()}\n{match[3]}", text)


def main() -> None:
    """Write the pages that changed, and the schema beside the gallery."""
    (ROOT / "models" / format_schema.FILE).write_text(format_schema.text(), encoding="utf-8", newline="\n")
    for page in pages():
        old = page.read_text(encoding="utf-8")
        new = made(old)
        if new != old:
            page.write_text(new, encoding="utf-8")
            sys.stdout.write(f"{page.name} written\n")


if __name__ == "__main__":
    main()
