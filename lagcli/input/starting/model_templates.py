"""Commented starts for models of one's own, a file each: `templates/NAME.yaml`."""

from __future__ import annotations

import pathlib
import re

FOLDER = pathlib.Path(__file__).parent / "templates"
# Name -> what it is a start for, in the order in which they are offered.
TEMPLATES = {
    "particles": "point masses on rods, with a force and a multiplier: a pendulum",
    "coordinates": "angles and other generalized coordinates: a double pendulum in the wind",
    "rolling": "rows of velocities that cannot be integrated: a disk that rolls",
    "mechanism": "a crank that is driven, a rod and a slider: the torque of a motor",
    "family": "many particles from a few lines: a chain",
    "box": "walls, impacts and events: a ball in a box",
}
_TITLE = "title: A new model\n"
# What YAML reads as a text of letters, in English at least.
_PLAIN = re.compile(r"[A-Za-z][A-Za-z0-9 _-]*[A-Za-z0-9_]")
_WORDS = {"true", "false", "null", "yes", "no", "on", "off"}


def text(template: str, title: str, *, for_editors: bool = True) -> str:
    """The text of a new model with this title.

    for_editors: whether it opens with the line that names its schema. Raises `KeyError` for a template there is not.
    """
    if template not in TEMPLATES:
        raise KeyError(template)
    from lagcli.input import format_schema  # here, as the names of the templates need none of it

    found = (FOLDER / f"{template}.yaml").read_text(encoding="utf-8")
    head = f"{format_schema.EDITOR_LINE}\n" if for_editors else ""
    return head + found.replace(_TITLE, f"title: {quoted(title)}\n", 1)


def quoted(text: str) -> str:
    """A text as YAML, on one line, whatever its characters."""
    if _PLAIN.fullmatch(text) and text.casefold() not in _WORDS:
        return text
    return '"' + "".join(map(_escaped, text)) + '"'


def _escaped(character: str) -> str:
    if character in '"\\':
        return f"\\{character}"
    if character.isprintable():
        return character
    code = ord(character)
    return f"\\x{code:02x}" if code < 0x100 else f"\\u{code:04x}" if code < 0x10000 else f"\\U{code:08x}"
