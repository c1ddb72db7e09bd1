"""Libraries of a few commands are not loaded by the others: what is imported counts, and no clock."""

from __future__ import annotations

import os
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


def test_a_run_without_contacts_and_errors_loads_nothing_of_them() -> None:
    code = (
        "import sys, lagcli\n"
        "lagcli.simulate(lagcli.load(sys.argv[1]), duration=0.1)\n"
        "print(*(name for name in sys.modules if name.startswith('lagcli.')))"
    )
    done = subprocess.run(
        [sys.executable, "-c", code, str(MODELS / "pendulum.yaml")],
        capture_output=True,
        text=True,
        check=True,
    )
    loaded = {name.rpartition(".")[2] for name in done.stdout.split()}
    assert {"dop853", "loop", "run_entry"} <= loaded
    assert not loaded & {
        "contact_event",
        "contact_change",
        "contact_instant",
        "impact_law",
        "reference_run",
        "collocation",
        "singularity_step",
        "work_integral",
        "classify",
    }


@pytest.mark.parametrize(
    "arguments",
    [("dof",), ("simulate", "--duration", "0.1", "-o", "run.csv")],
)
def test_a_plain_command_loads_nothing_of_checkpoints_and_random_numbers(
    arguments: tuple[str, ...], tmp_path: pathlib.Path
) -> None:
    code = (
        "import sys\nfrom lagcli import __main__\n"
        "try:\n    __main__.main()\n"
        "except SystemExit as end:\n    assert not end.code\n"
        "print('loaded', *sys.modules)"
    )
    done = subprocess.run(
        [sys.executable, "-c", code, arguments[0], str(MODELS / "pendulum.yaml"), *arguments[1:]],
        capture_output=True,
        text=True,
        check=True,
        cwd=tmp_path,
    )
    loaded = set(done.stdout.partition("loaded")[2].split())
    assert "lagcli.equations.system" in loaded
    assert not loaded & {
        "numpy.random",
        "numpy.polynomial",
        "lagcli.output.tables.row_file",
        "lagcli.running.rows_before",
        "lagcli.simulation.run_state.saved_form",
    }
    assert ("lagcli.simulation.loop" in loaded) == (arguments[0] == "simulate")


@pytest.mark.parametrize("chosen", [None, "2"])
def test_the_program_runs_linear_algebra_on_one_thread_unless_told_otherwise(chosen: str | None) -> None:
    """Threads that wait took a quarter of the processor time of a short run."""
    names = ("OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "VECLIB_MAXIMUM_THREADS")
    environment = {name: value for name, value in os.environ.items() if name not in names}
    if chosen is not None:
        environment |= dict.fromkeys(names, chosen)
    code = (
        "import os, sys\n"
        "import lagcli\n"
        f"assert [os.environ.get(name) for name in {names}] == [{chosen!r}] * 3, 'the caller of the library decides'\n"
        "from lagcli import __main__\n"
        "try:\n    __main__.main()\n"
        "except SystemExit as end:\n    assert not end.code\n"
        f"print('threads', *(os.environ.get(name) for name in {names}))"
    )
    done = subprocess.run(
        [sys.executable, "-c", code, "dof", str(MODELS / "pendulum.yaml")],
        capture_output=True,
        text=True,
        check=True,
        env=environment,
    )
    assert done.stdout.partition("threads")[2].split() == [chosen or "1"] * 3
