"""The models of the gallery, wherever this installation has them: in the package, or beside it in a checkout."""

from __future__ import annotations

import functools
import pathlib
import re

from lagcli import yaml_tree
from lagcli.frozen import frozen_value
from lagcli.input import format_schema

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
        text = self.path.read_text(encoding="utf-8")
        return text.removeprefix(f"{format_schema.EDITOR_LINE}\n")

    def title(self) -> str:
        """The title in the file, or nothing."""
        node = yaml_tree.parse(self.text(), self.name).get("title")
        return node.value if isinstance(node, yaml_tree.Scalar) else ""


@functools.cache
def models() -> tuple[GalleryModel, ...]:
    """All models in the order of the index, which groups them by subject; none where the gallery was not installed."""
    folder = _folder()
    if folder is None:
        return ()
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


def _folder() -> pathlib.Path | None:
    """The folder of the gallery: that of a wheel, or of the checkout that this package stands in."""
    installed, checkout = _PACKAGE / "gallery", _PACKAGE.parent / "models"
    if (installed / _INDEX).is_file():
        return installed
    # Another project's folder `models` may stand beside an installed package.
    if (_PACKAGE.parent / "pyproject.toml").is_file() and (checkout / _INDEX).is_file():
        return checkout
    return None
