"""The refusal of a file that is no table, and of a cell that is no text."""

import json
from pathlib import Path

SHOWN = 60  # characters of what is no number
MOST_TEXT = 1000  # characters of a text: a kind or a name


class UnreadableTable(ValueError):
    """The file is no table in the format that its ending names, or too large."""


def bad(path: Path, reason: object) -> UnreadableTable:
    """The refusal, with its reason."""
    return UnreadableTable(f"{path} is no table in the format .{path.suffix.lower()[1:]}: {reason}")


def as_text(path: Path, cell: object, row: int, name: str) -> str:
    """A cell of a column of text. Raises `UnreadableTable`."""
    if not isinstance(cell, str) or len(cell) > MOST_TEXT:
        raise bad(path, f"row {row}: {name[:SHOWN]!r} holds {str(cell)[:SHOWN]!r}, which is no word")
    return cell


def provenance(text: bytes | None) -> dict[str, object] | None:
    """The provenance in the comment or the metadata of a file; None where there is none, or another text."""
    try:
        found = json.loads(text) if text else None
    except (ValueError, RecursionError):
        return None
    return found if isinstance(found, dict) else None
