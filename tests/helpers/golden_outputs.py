"""What commands write, without what may differ between processors, versions and days: for `tests.goldens`."""

from __future__ import annotations

import csv
import io
import json
import re
import tempfile
from collections.abc import Callable, Iterator
from pathlib import Path

from tests.helpers.in_process import run

# Of numbers that come out of searches and integrations: their sums are rounded differently on other processors.
# Relative above 1, absolute below.
NEARLY = 1e-6
# Of how a result was found: they count rounding, or the work that it took.
_HOW = ("residual", "steps", "uncertainty", "mean_uncertainty", "starts", "notes")
_OF_THE_FILE = ("| SHA-256", "| model file")
_FIGURE = re.compile(r"(?<![\w.])-?\d+(\.\d+)*(e[+-]?\d+)?")
Write = Callable[[Path], None]
Leaves = dict[str, object]


def _written(arguments: tuple[object, ...], ending: str) -> str:
    """The file a command writes with -o. Raises RuntimeError where it ends with another exit code than 0."""
    with tempfile.TemporaryDirectory() as folder:
        target = Path(folder) / f"out{ending}"
        _, err, code = run(*arguments, "-o", target)
        if code:
            raise RuntimeError(f"exit {code}: {err}")
        return target.read_text(encoding="utf-8")


def drawing(*arguments: object) -> Write:
    """Writes the texts of an SVG, in their order, and how many paths of each style and marks it has."""

    def write(path: Path) -> None:
        image = _written(arguments, ".svg")
        texts = re.findall(r"<!-- (.*?) -->", image)
        styles = sorted(re.findall(r"stroke: (#[0-9a-f]+)", image))
        counts = [f"{styles.count(colour)} strokes {colour}" for colour in sorted(set(styles))]
        path.write_text("\n".join((*texts, *counts)) + "\n", encoding="utf-8")

    return write


def scene(*arguments: object) -> Write:
    """Writes the names of all that moves on the page of an animation, and how many instants it has."""

    def write(path: Path) -> None:
        page = _written(arguments, ".html")
        data = json.loads(page.partition('id="scene">')[2].partition("</script>")[0])
        lines = [f"instants: {data['t'][1]}", f"particles: {data['names']}", f"units: {data['units']}"]
        lines += [f"{link['kind']} {link['a']} {link['b']}" for link in data["links"]]
        lines += [f"surface: {surface['kind']}" for surface in data["surfaces"]]
        lines += [f"curve {curve['name']}" for curve in data["curves"]]
        path.write_text("\n".join((*lines, *data["notes"])) + "\n", encoding="utf-8")

    return write


def report(*arguments: object) -> Write:
    """Writes the Markdown of a report with # for every figure; of a check of the audit its name and equation, for
    where it is worst rounding may say."""

    def write(path: Path) -> None:
        lines = [
            line for line in _written(arguments, ".md").splitlines() if not line.startswith(_OF_THE_FILE)
        ]
        start = lines.index("## Audit")
        rows = [
            " | ".join(line.split(" | ")[:2]) if line.startswith("| ") else line for line in lines[start:]
        ]
        text = "\n".join((*lines[:start], *rows))
        path.write_text(_FIGURE.sub("#", text) + "\n", encoding="utf-8")

    return write


def values(*arguments: object) -> Write:
    """Writes the leaves of what a command says as JSON, each with its path, to be compared by `differences`."""

    def write(path: Path) -> None:
        out, err, code = run(*arguments, "--json")
        found = {"exit": code, **dict(_leaves(json.loads(out)))} if out else {"exit": code, "error": err}
        path.write_text(json.dumps(found, indent=1) + "\n", encoding="utf-8")

    return write


def rows(*arguments: object) -> Write:
    """Writes the cells of the CSV table on standard output, by column and row, to be compared by `differences`."""

    def write(path: Path) -> None:
        out, _, code = run(*arguments, "-o", "-")
        table = [
            {name: _number(cell) for name, cell in row.items()} for row in csv.DictReader(io.StringIO(out))
        ]
        path.write_text(json.dumps({"exit": code, **dict(_leaves(table))}, indent=1) + "\n", encoding="utf-8")

    return write


def differences(old: Path, new: Path) -> list[str]:
    """The leaves that are not the same, or where both are numbers not nearly the same."""
    before, after = (json.loads(path.read_text(encoding="utf-8")) for path in (old, new))
    return [
        f"{name}: {before.get(name, 'not there')} -> {after.get(name, 'not there')}"
        for name in dict.fromkeys((*before, *after))
        if name not in before or name not in after or not _same(before[name], after[name])
    ]


def _same(a: object, b: object) -> bool:
    if type(a) is float and type(b) is float:
        return abs(a - b) <= NEARLY * max(1.0, abs(a))
    return type(a) is type(b) and a == b


def _number(cell: str) -> float | str:
    try:
        return float(cell)
    except ValueError:
        return cell


def _leaves(data: object, at: str = "") -> Iterator[tuple[str, object]]:
    """Pairs (path, text, number or nothing)."""
    if isinstance(data, dict):
        for key, part in data.items():
            if key not in _HOW:
                yield from _leaves(part, f"{at}/{key}")
    elif isinstance(data, list):
        for k, part in enumerate(data):
            yield from _leaves(part, f"{at}/{k}")
    else:
        yield at, data
