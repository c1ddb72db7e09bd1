"""Libraries of a few commands are not loaded by the others: what is imported counts, and no clock."""

from __future__ import annotations

import pathlib
import subprocess
import sys

import pytest

MODELS = pathlib.Path(__file__).parents[2] / "models"


@pytest.mark.parametrize(
    "call",
    [
        "dof(m)",
        "check(m)",
        "displacements(m)",
        "derive(m)",
        "simulate(m, samples=3)",
        "compare(m, samples=3)",
    ],
)
def test_commands_that_linearize_nothing_load_no_scipy(call: str) -> None:
    """SciPy serves points of rest, modes and contacts."""
    code = f"import sys, lagcli\nm = sys.argv[1]\nlagcli.{call}\nprint('scipy' in sys.modules)"
    done = subprocess.run(
        [sys.executable, "-c", code, str(MODELS / "knife-edge.yaml")],
        capture_output=True,
        text=True,
        check=True,
    )
    assert done.stdout.split() == ["False"]
