"""Text files that a command makes for the user to go on with: never over another one in silence."""

from __future__ import annotations

import json
import os
from collections.abc import Callable
from pathlib import Path

from lagcli.cli.terminal import exits
from lagcli.output.files import atomic_file, write_guard

STDOUT = "-"
# More than any model or schema; a file of this size is another one without looking.
MOST = 2**25


def never(old: str) -> bool:
    """The rule by which no file may be replaced."""
    return False


def write(name: str, text: str, *, force: bool = False, may_replace: Callable[[str], bool] = never) -> bool:
    """Write a text to a file, or to standard output for `-`; False where the file holds this text already.

    may_replace: whether a file with this text may be written over without `force`. Raises `exits.UsageError` where
    another file is there, `write_guard.WriteError` where the file cannot be written.
    """
    if name == STDOUT:
        print(text, end="")
        return True
    target = Path(name)
    with write_guard.writing(name):
        old = _old(target)
        if old == text:
            return False
        if old is not None and not force and not may_replace(old):
            raise exits.UsageError(f"{name} is there already, and another file; --force writes over it")
        pending = atomic_file.PendingFile(target)
        with atomic_file.undone_by(pending.discard):
            pending.path.write_bytes(text.encode())
            pending.commit()
    return True


def schema_beside(model: str) -> str:
    """Write the schema into the folder of a model, where none is; the message about it, or nothing.

    Raises `write_guard.WriteError`.
    """
    from lagcli.input import format_schema

    name = os.path.join(os.path.dirname(model), format_schema.FILE)
    if os.path.lexists(name):
        with write_guard.writing(name):
            same = _old(Path(name)) == format_schema.text()
        return "" if same else f"{name} is of another version; `lagcli schema -o {name}` writes it anew"
    write(name, format_schema.text())
    return f"wrote {name}, by which editors complete and check models"


def is_schema(old: str) -> bool:
    """True for a schema of the model format, of whatever version."""
    try:
        found = json.loads(old)
    except ValueError:
        return False
    return isinstance(found, dict) and str(found.get("title", "")).startswith("lagcli model")


def _old(target: Path) -> str | None:
    """The text of a file there is; None where there is none, or what is no file to replace."""
    if not target.is_file():
        return None
    with target.open("rb") as file:
        return file.read(MOST).decode("utf-8", "replace")
