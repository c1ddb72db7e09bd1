"""First models: those of the gallery, in the package or beside it in a checkout, and commented starts for models of
one's own, a file each: `templates/NAME.yaml`."""

from __future__ import annotations

import functools
import pathlib
import re

from lagcli.frozen import frozen_value

_PACKAGE = pathlib.Path(__file__).parents[2]
_INDEX = "README.md"
# A row of the index: a link to the model, and what it teaches.
_ROW = re.compile(r"\| \[[\w-]+\]\(([\w-]+)\.yaml\) \| ([^|]*) \|")


@frozen_value
class GalleryModel:
    """One model: its name, its subject, what it teaches in a line, and its file."""

    name: str
    subject: str
    teaches: str
    path: pathlib.Path

    def text(self) -> str:
        """The file, without its line for editors, which belongs beside a schema."""
        from lagcli.input import format_schema  # here, as names of models and templates need none of it

        text = self.path.read_text(encoding="utf-8")
        return text.removeprefix(f"{format_schema.EDITOR_LINE}\n")

    def title(self) -> str:
        from lagcli import yaml_tree

        node = yaml_tree.parse(self.text(), self.name).get("title")
        return node.value if isinstance(node, yaml_tree.Scalar) else ""


@functools.cache
def models() -> tuple[GalleryModel, ...]:
    """All models in the order of the index, which groups them by subject; none where the gallery was not installed."""
    # The folder of a wheel, or of the checkout that this package stands in; another project's folder `models` may stand
    # beside an installed package.
    folder, checkout = _PACKAGE / "gallery", _PACKAGE.parent / "models"
    if not (folder / _INDEX).is_file():
        if not (_PACKAGE.parent / "pyproject.toml").is_file() or not (checkout / _INDEX).is_file():
            return ()
        folder = checkout
    found, subject = [], ""
    for line in (folder / _INDEX).read_text(encoding="utf-8").splitlines():
        if line.startswith("## "):
            subject = line[3:].strip()
        elif row := _ROW.match(line):
            path = folder / f"{row[1]}.yaml"
            found.append(GalleryModel(row[1], subject, row[2].replace("`", ""), path))
    return tuple(found)


def find(name: str) -> GalleryModel | None:
    """The model of this name, with or without `.yaml`; None where there is none."""
    wanted = name.strip().removesuffix(".yaml").removesuffix(".yml")
    return next((model for model in models() if model.name == wanted), None)


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
    """The text of a new model with this title. for_editors: whether it opens with the line that names its schema.
    Raises `KeyError` for a template there is not."""
    if template not in TEMPLATES:
        raise KeyError(template)
    from lagcli.input import format_schema  # here, as for the gallery

    found = (FOLDER / f"{template}.yaml").read_text(encoding="utf-8")
    head = f"{format_schema.EDITOR_LINE}\n" if for_editors else ""
    return head + found.replace(_TITLE, f"title: {quoted(title)}\n", 1)


def quoted(text: str) -> str:
    """A text as YAML, on one line, whatever its characters."""
    if _PLAIN.fullmatch(text) and text.casefold() not in _WORDS:
        return text
    written = ""
    for character in text:
        if character in '"\\':
            written += f"\\{character}"
        elif character.isprintable():
            written += character
        else:  # Python's own escape, but for that of a line's end and the like
            code = ord(character)
            written += f"\\x{code:02x}" if code < 0x100 else character.encode("unicode_escape").decode()
    return f'"{written}"'
