"""What the program says today, kept to be compared with what it says after a change that must change nothing.

    python -m tests.goldens record FOLDER
    python -m tests.goldens compare FOLDER [--only PART]

Recorded are, of every model of the gallery, `check --json`, `dof --json`, `derive` in its formats and 200 rows of
`simulate`; the help of every command, the pages of `explain` and the signatures of the Python API; of the other
commands the results of one small model each. Numbers are compared to 1e-13 of the largest in their column (both on
one machine: other processors round sums otherwise), those of the other commands to 1e-6 (`golden_outputs`), texts
letter by letter. The folder is outside the repository.
"""

import argparse
import difflib
import inspect
import json
import sys
from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np

import lagcli
from lagcli.cli import commands
from lagcli.input.starting import first_models
from tests.helpers import golden_outputs
from tests.helpers.in_process import run

MODELS = Path(__file__).resolve().parent.parent / "models"
SAMPLES = 200
TOLERANCE = 1e-13
BRIEF = ("--duration", "1", "--samples", "20")
Part = tuple[str, Callable[[Path], None]]


def said(*arguments: object) -> Callable[[Path], None]:
    """Writes what a command says and its exit code."""

    def write(path: Path) -> None:
        out, err, code = run(*arguments)
        path.write_text(f"{out}\n--- stderr\n{err}\n--- exit {code}\n", encoding="utf-8")

    return write


def table(model: Path) -> Callable[[Path], None]:
    """Writes the columns of a run of `SAMPLES` rows, or why there is none."""

    def write(path: Path) -> None:
        try:
            found = lagcli.simulate(lagcli.load(model), samples=SAMPLES)
        except lagcli.ModelError as error:
            columns, rows = [str(error)], np.zeros((0, 1))
        else:
            columns, rows = list(found.columns), found.rows
        np.savez_compressed(path, columns=np.array(columns), rows=rows)

    return write


def api(path: Path) -> None:
    """Writes the signatures of the Python API."""
    lines = []
    for name in sorted(lagcli.__all__):
        thing = getattr(lagcli, name)
        lines.append(f"{name}{'' if isinstance(thing, type) else inspect.signature(thing)}")
    path.write_text("\n".join(lines) + "\n", encoding="utf-8")


def results() -> Iterator[Part]:
    """Those of the commands that need no model, or one small model."""
    yield "models.json", said("models", "--json")
    yield "schema.txt", said("schema")
    for template in first_models.TEMPLATES:
        yield f"new/{template}.txt", said("new", "-", "--template", template)
    pendulum, double = MODELS / "pendulum.yaml", MODELS / "double-pendulum.yaml"
    yield "plot/pendulum.txt", golden_outputs.drawing("plot", pendulum, *BRIEF)
    yield (
        "plot/paths.txt",
        golden_outputs.drawing("plot", double, "--xy", "a.x,a.z", "--xy", "b.x,b.z", *BRIEF),
    )
    for model in (double, MODELS / "sphere-fall-off.yaml"):
        yield f"animate/{model.stem}.txt", golden_outputs.scene("animate", model, *BRIEF)
    yield "report/pendulum.txt", golden_outputs.report("report", pendulum, *BRIEF)
    yield "sweep/pendulum.values", golden_outputs.rows("sweep", pendulum, "--over", "m=1:2:3", *BRIEF)
    yield "equilibrium/double-pendulum.values", golden_outputs.values("equilibrium", double, "--starts", "8")
    yield "modes/double-pendulum.values", golden_outputs.values("modes", double)
    stick, stiffness = MODELS / "driven-stick.yaml", ("--stiffness", "1e3:1e4:3")
    limit = golden_outputs.values("limit", stick, "--constraint", "stick", *stiffness, *BRIEF)
    yield "limit/driven-stick.values", limit
    yield "stationary/pendulum.values", golden_outputs.values("stationary", pendulum, "--of", "a.z")


def parts() -> Iterator[Part]:
    """Name of a file and what writes it."""
    yield "api.txt", api
    yield "help/lagcli.txt", said("--help")
    for command in commands.COMMANDS:
        yield f"help/{command}.txt", said(command, "--help")
    yield "explain.txt", said("explain")
    yield from results()
    for model in sorted(MODELS.glob("*.yaml")):
        yield f"check/{model.stem}.json", said("check", "--json", model)
        yield f"dof/{model.stem}.json", said("dof", "--json", model)
        for form in ("text", "latex", "markdown", "html", "json"):
            yield f"derive/{model.stem}.{form}", said("derive", "--format", form, model)
        yield f"rows/{model.stem}.npz", table(model)


def agree(old: Path, new: Path) -> list[str]:
    """The differences of two recorded files; nothing where they agree."""
    if not old.exists():
        return ["was not recorded"]
    if old.suffix == ".values":
        return golden_outputs.differences(old, new)
    if old.suffix == ".npz":
        before, after = np.load(old), np.load(new)
        if list(before["columns"]) != list(after["columns"]):
            return ["other columns"]
        if before["rows"].shape != after["rows"].shape:
            return [f"{after['rows'].shape} rows and columns in place of {before['rows'].shape}"]
        size = np.nanmax(np.abs(before["rows"]), axis=0, initial=1e-300)
        off = np.abs(after["rows"] - before["rows"]) > TOLERANCE * size
        off |= np.isnan(after["rows"]) != np.isnan(before["rows"])
        return [f"column {name}" for name in before["columns"][off.any(axis=0)]]
    lines = [path.read_text(encoding="utf-8").splitlines() for path in (old, new)]
    return [line for line in difflib.unified_diff(*lines, lineterm="", n=0) if line[:3] not in ("---", "+++")]


def main(what: str, folder: Path, only: str = "") -> int:
    """Record, or compare and print; 1 where something differs."""
    failed = 0
    for name, write in parts():
        if only not in name:
            continue
        old = folder / name
        path = old if what == "record" else folder / "now" / name
        path.parent.mkdir(parents=True, exist_ok=True)
        write(path)
        found = agree(old, path) if what == "compare" else []
        if found:
            failed = 1
            print(json.dumps(name), *found[:20], sep="\n  ")
    print("recorded" if what == "record" else "differences" if failed else "all agree")
    return failed


if __name__ == "__main__":
    asked = argparse.ArgumentParser(
        prog="python -m tests.goldens", description=(__doc__ or "").partition("\n")[0]
    )
    asked.add_argument("what", choices=("record", "compare"))
    asked.add_argument("folder", type=Path)
    asked.add_argument("--only", metavar="PART", default="", help="parts whose name holds this alone")
    sys.exit(main(**vars(asked.parse_args())))
