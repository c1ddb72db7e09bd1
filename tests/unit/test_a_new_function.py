"""A function that the language does not have is one row more in a copy of the program, and every part knows it."""

from __future__ import annotations

import json
import os
import shutil
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import lagcli

ROW = """ROWS = (
    Function(
        "asinh", math.asinh, np.arcsinh, "rises",
        slope=lambda of, x, y: 1 / of.sqrt(x * x + 1), written="arsinh",
    ),
"""
MODEL = """\
lagcli: 1
parameters: {{k: "{asinh}(2)"}}
coordinates:
  x: {{value: 0.7}}
  y: {{value: 0.4, rate: 0.2}}
  z: {{value: "{asinh}(0.7)"}}
particles: {{a: {{mass: 2, position: [x, y, z]}}}}
forces:
  spring: {{potential: "k*{asinh}(y)**2"}}
  pull: {{to: x, force: "-{asinh}(x + t)"}}
holonomic: {{bent: "z = {asinh}(x)"}}
outputs: {{size: "{asinh}(x*y)"}}
simulation: {{duration: 1, samples: 5}}
"""
SCRIPT = """
import json, sys
from decimal import Decimal
import casadi as ca, numpy as np, sympy
import lagcli
from lagcli.expression import term_sizes
from lagcli.compiled import multiprecision
from lagcli.compiled import program
from lagcli.expression import functions, intervals
from lagcli.pfaffian.forms import notation

m = lagcli.loads(open(sys.argv[1]).read())
run = lagcli.simulate(m)
x = ca.SX.sym("x")
written = program.written_out(ca.Function("f", [x], [functions.meaning(ca, "", "asinh")(x)]))
point = multiprecision.moved([Decimal("0.5")], [Decimal(1)], 1)
changed = multiprecision.parts(multiprecision.run(written, [point], Decimal), 1)[1]
low, high = intervals.ARRAYS.result("asinh", (np.array([-1.0]), np.array([2.0])))
print(json.dumps({
    "columns": run.columns,
    "rows": run.rows.tolist(),
    "dof": lagcli.dof(m).configuration_dof,
    "audit": lagcli.audit(m).passed,
    "text": lagcli.derive(m).text(),
    "latex": lagcli.derive(m).latex(),
    "slope": float(changed[0]),
    "size": term_sizes.of(written, [np.array([0.5])]).tolist(),
    "range": [low.item(), high.item()],
    "sympy": notation.written(sympy.asinh(sympy.Symbol("x"))),
}))
"""


@pytest.fixture(scope="module")
def patched(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A copy of the program with one row more."""
    root = tmp_path_factory.mktemp("patched")
    shutil.copytree(
        Path(lagcli.__file__).parent, root / "lagcli", ignore=shutil.ignore_patterns("__pycache__")
    )
    table = root / "lagcli" / "expression" / "functions.py"
    text = table.read_text(encoding="utf-8")
    # CasADi has it for its own use: it moves to the language.
    lines = [line for line in text.splitlines(keepends=True) if not line.lstrip().startswith('"asinh": (')]
    assert (text.count("ROWS = (\n"), len(lines)) == (1, text.count("\n") - 1)
    table.write_text("".join(lines).replace("ROWS = (\n", ROW), encoding="utf-8")
    return root


@pytest.fixture(scope="module")
def told(patched: Path) -> dict[str, Any]:
    """What the parts of that program say of a model with the function."""
    (patched / "model.yaml").write_text(MODEL.format(asinh="asinh"), encoding="utf-8")
    done = subprocess.run(
        [sys.executable, "-c", SCRIPT, "model.yaml"],
        cwd=patched,
        env={**os.environ, "PYTHONPATH": str(patched)},
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    found: dict[str, Any] = json.loads(done.stdout)
    return found


def test_the_language_does_not_have_it() -> None:
    with pytest.raises(lagcli.ModelError, match="asinh"):
        lagcli.loads(MODEL.format(asinh="asinh"))


def test_the_reader_and_casadi_know_it(told: dict[str, Any]) -> None:
    """The motion, lambda and R are those of the same model with the function written out."""
    asinh = {x: f"log({x} + sqrt(({x})**2 + 1))" for x in ("2", "0.7", "y", "x + t", "x", "x*y")}
    text = MODEL.replace("{{", "{").replace("}}", "}")
    for x, written in asinh.items():
        text = text.replace(f"{{asinh}}({x})", f"({written})")
    run = lagcli.simulate(lagcli.loads(text))
    assert told["columns"] == list(run.columns)
    np.testing.assert_allclose(told["rows"], run.rows, rtol=1e-8, atol=1e-10)
    assert told["dof"] == 2


def test_the_audit_knows_it(told: dict[str, Any]) -> None:
    assert told["audit"] is True


def test_derived_equations_know_it(told: dict[str, Any]) -> None:
    assert "arsinh" in told["text"]
    assert r"\operatorname{arsinh}" in told["latex"]
    assert told["sympy"] == "asinh(x)"


def test_intervals_sizes_and_many_digits_know_it(told: dict[str, Any]) -> None:
    np.testing.assert_allclose(told["range"], np.arcsinh([-1.0, 2.0]), rtol=1e-14)
    assert told["range"][0] < np.arcsinh(-1.0)
    assert told["range"][1] > np.arcsinh(2.0)
    np.testing.assert_allclose(told["slope"], 1 / np.sqrt(1.25), rtol=1e-15)
    # Of the term itself, and of the argument by the slope.
    np.testing.assert_allclose(told["size"], np.arcsinh(0.5) + 0.5 / np.sqrt(1.25), rtol=1e-14)
