"""The notebooks of the documentation: their cells run one after the other, and give what they show as text."""

from __future__ import annotations

import ast
import contextlib
import io
import json
import re
import shutil
from pathlib import Path

import pytest

NOTEBOOKS = sorted((Path(__file__).parents[2] / "docs" / "notebooks").glob("*.ipynb"))
NUMBER = re.compile(r"[-+−]?\d+(?:\.\d+)?(?:e[-+]?\d+)?")


def run_cell(code: str, space: dict[str, object]) -> tuple[str, object]:
    """What a cell prints, and the value of its last line."""
    tree = ast.parse(code)
    last = tree.body.pop() if tree.body and isinstance(tree.body[-1], ast.Expr) else None
    printed, value = io.StringIO(), None
    with contextlib.redirect_stdout(printed):
        exec(compile(tree, "cell", "exec"), space)
        if last is not None:
            value = eval(compile(ast.Expression(last.value), "cell", "eval"), space)
    return printed.getvalue(), value


def are_alike(shown: str, found: str) -> bool:
    """Letter for letter between the numbers, and these to the digits that tell anything."""
    if NUMBER.split(shown) != NUMBER.split(found):
        return False
    pairs = zip(NUMBER.findall(shown), NUMBER.findall(found), strict=True)
    return all(
        float(a.replace("−", "-")) == pytest.approx(float(b.replace("−", "-")), rel=1e-3) for a, b in pairs
    )


def test_there_are_three_notebooks() -> None:
    assert len(NOTEBOOKS) == 3


@pytest.mark.parametrize("path", NOTEBOOKS, ids=lambda path: path.stem)
def test_a_notebook_gives_what_it_shows(path: Path) -> None:
    cells = json.loads(path.read_text(encoding="utf-8"))["cells"]
    if any("import pandas" in "".join(cell["source"]) for cell in cells):
        pytest.importorskip("pandas")
    space: dict[str, object] = {}
    pictures = 0
    for cell in cells:
        if cell["cell_type"] != "code":
            continue
        printed, value = run_cell("".join(cell["source"]), space)
        shown = {output["output_type"]: output for output in cell["outputs"]}
        assert are_alike("".join(shown.pop("stream", {"text": []})["text"]), printed), cell["source"]
        result = shown.pop("execute_result", None)
        assert not shown
        assert (result is None) == (value is None)
        if result is None:
            continue
        if "image/png" in result["data"]:
            pictures += 1
            assert value._repr_png_().startswith(b"\x89PNG")  # type: ignore[attr-defined]
            continue
        assert are_alike("".join(result["data"]["text/plain"]), repr(value)), cell["source"]
        assert ("text/html" in result["data"]) == hasattr(value, "_repr_html_")
    assert pictures >= 1


def test_the_page_on_pandas_runs(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    pytest.importorskip("pandas")
    page = (Path(__file__).parents[2] / "docs" / "how-to" / "pandas.md").read_text(encoding="utf-8")
    shutil.copytree(Path(__file__).parents[2] / "models", tmp_path / "models")
    monkeypatch.chdir(tmp_path)
    space: dict[str, object] = {}
    for code in re.findall(r"```python\n(.*?)```", page, re.DOTALL):
        run_cell(code, space)
    assert Path("forces.csv").stat().st_size > 1000
