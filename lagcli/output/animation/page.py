"""The page of an animation: one HTML file that needs nothing else, with three.js and all numbers in it."""

from __future__ import annotations

import base64
import functools
import hashlib
import html
import pathlib
import string

from lagcli import __version__
from lagcli.output.animation import packing, still
from lagcli.output.animation.scene import Scene
from lagcli.output.figures import labels
from lagcli.output.files import atomic_file

ASSETS = pathlib.Path(__file__).with_name("assets")
LIBRARY = "three-0.180.0.min.js"
MOST_BYTES = 2_000_000  # of a page, so that it can be sent by mail and opens at once


def text(scene: Scene) -> str:
    """The page. All text of the model is escaped, and the policy of the page allows only its own two scripts."""
    title = html.escape(labels.shortened(scene.title, labels.TITLE))
    data, numbers = packing.packed(scene)
    library, page, css = (_asset(name) for name in (LIBRARY, "page.js", "page.css"))
    return string.Template(_asset("page.html")).substitute(
        TITLE=title,
        VERSION=html.escape(__version__),
        SCRIPTS=f"{_hash(library)} {_hash(page)}",
        STYLES=_hash(css),
        CSS=css,
        STILL=still.svg(scene),
        SCENE=in_script(data),
        NUMBERS=numbers,
        THREE=library,
        PAGE=page,
    )


def write(path: pathlib.Path, scene: Scene) -> int:
    """Write the page aside and move it into place; return its number of bytes. Raises OSError."""
    content = text(scene).encode("utf-8")
    file = atomic_file.Aside(path)
    with atomic_file.undone_by(file.discard):
        file.path.write_bytes(content)
    file.commit()
    return len(content)


def fixed_bytes() -> int:
    """The bytes of a page without a scene."""
    return sum(len(_asset(name).encode("utf-8")) for name in (LIBRARY, "page.js", "page.css", "page.html"))


def in_script(data: str) -> str:
    """JSON that cannot end the tag it stands in, nor begin a comment there."""
    for letter in "<>&\u2028\u2029":
        data = data.replace(letter, f"\\u{ord(letter):04x}")
    return data


@functools.cache
def _asset(name: str) -> str:
    return (ASSETS / name).read_text(encoding="utf-8")


def _hash(content: str) -> str:
    digest = hashlib.sha256(content.encode("utf-8")).digest()
    return f"'sha256-{base64.b64encode(digest).decode('ascii')}'"
