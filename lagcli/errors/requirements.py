"""Oldest versions of the libraries that lagcli works with, those of pyproject.toml, and the refusal of older ones."""

from __future__ import annotations

import functools
import os
import re
import sys
from collections.abc import Collection

OLDEST = {
    "casadi": "3.6.7",
    "jinja2": "3.1",
    "llvmlite": "0.45",
    "matplotlib": "3.8",
    "mpmath": "1.3",
    "numpy": "1.26",
    "orjson": "3.10",
    "plotille": "5.0",
    "pyarrow": "15",
    "pyyaml": "6.0.1",
    "rich": "13.7",
    "scipy": "1.11",
    "sympy": "1.12",
    "typer": "0.20",
}


OPTIONAL = ("llvmlite", "pyarrow")


def too_old(names: Collection[str] = OLDEST.keys() - set(OPTIONAL)) -> str:
    """A line for each installed library among `names` that is too old, with the command that upgrades it; else ""."""
    suspects = [name for name in sorted(names) if _is_older(_listed().get(name, ""), OLDEST[name])]
    if not suspects:
        return ""
    # The loader of metadata takes 30 ms, and knows which of several copies counts.
    from importlib import metadata

    return "\n".join(
        f"lagcli needs {name} {OLDEST[name]} or newer, and {version} is installed; upgrade it with"
        f' `{os.path.basename(sys.executable) or "python"} -m pip install --upgrade "{name}>={OLDEST[name]}"`'
        for name in suspects
        if _is_older(version := metadata.version(name), OLDEST[name])
    )


@functools.cache
def _listed() -> dict[str, str]:
    """Versions by the names of the folders that installers leave, of the first folder on the path that has one."""
    found: dict[str, str] = {}
    for folder in sys.path:
        try:
            entries = os.listdir(folder or os.curdir)
        except OSError:  # a folder on the path need not exist
            continue
        for entry in entries:
            stem, ending = os.path.splitext(entry)
            if ending not in (".dist-info", ".egg-info"):
                continue
            name, _, version = stem.partition("-")
            name = re.sub(r"[-_.]+", "-", name).lower()
            if name in OLDEST:
                found.setdefault(name, version.partition("-")[0])
    return found


def _is_older(version: str, oldest: str) -> bool:
    """True if a version comes before another, by its numbers; False where it has none."""
    here, there = _numbers(version), _numbers(oldest)
    return bool(here) and here < there


def _numbers(version: str) -> tuple[int, ...]:
    """Its leading numbers without zeros at the end: 3.10.0rc1 is (3, 10)."""
    found = re.match(r"\d+(?:\.\d+)*", version)
    numbers = [int(part) for part in found.group().split(".")] if found else []
    while numbers and numbers[-1] == 0:
        numbers.pop()
    return tuple(numbers)
