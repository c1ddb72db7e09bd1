"""The page of an animation: one HTML file that needs nothing else, with three.js and all numbers in it.

The scene stands in it as JSON and one block of numbers: 32-bit floats in base64, each array named by its offset and its
length.
"""

from __future__ import annotations

import base64
import hashlib
import html
import json
import pathlib
import string
from collections.abc import Sequence

import numpy as np
import numpy.typing as npt

from lagcli import __version__, memory
from lagcli.output.animation import still
from lagcli.output.animation.scene import DrawnSurface, Link, Mode, Scene, TimeCurve
from lagcli.output.figures import labels
from lagcli.output.files import atomic_file

Floats = npt.NDArray[np.float64]

ASSETS = pathlib.Path(__file__).with_name("assets")
LIBRARY = "three-0.180.0.min.js"
MOST_BYTES = 2_000_000  # of a page, so that it can be sent by mail and opens at once


def text(scene: Scene) -> str:
    """The page. All text of the model is escaped, and the policy of the page allows only its own two scripts."""
    title = html.escape(labels.shortened(scene.title, labels.TITLE))
    data, numbers = packed(scene)
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
    atomic_file.write(path, content)
    return len(content)


def fixed_bytes() -> int:
    """The bytes of a page without a scene."""
    return sum(len(_asset(name).encode("utf-8")) for name in (LIBRARY, "page.js", "page.css", "page.html"))


def in_script(data: str) -> str:
    """JSON that cannot end the tag it stands in, nor begin a comment there."""
    for letter in "<>&\u2028\u2029":
        data = data.replace(letter, f"\\u{ord(letter):04x}")
    return data


@memory.remembered()
def _asset(name: str) -> str:
    return (ASSETS / name).read_text(encoding="utf-8")


def _hash(content: str) -> str:
    digest = hashlib.sha256(content.encode("utf-8")).digest()
    return f"'sha256-{base64.b64encode(digest).decode('ascii')}'"


class _Block:
    """Numbers one after another; equal arrays stand there once."""

    def __init__(self) -> None:
        self._parts: list[npt.NDArray[np.float32]] = []
        self._known: dict[bytes, list[int]] = {}
        self._size = 0

    def add(self, values: Floats) -> list[int]:
        """The offset of an array and its length."""
        flat = np.ascontiguousarray(values, dtype="<f4").ravel()
        key = flat.tobytes()
        if key not in self._known:
            self._known[key] = [self._size, flat.size]
            self._parts.append(flat)
            self._size += flat.size
        return self._known[key]

    def text(self) -> str:
        """All numbers in base64."""
        return base64.b64encode(b"".join(part.tobytes() for part in self._parts)).decode("ascii")


def packed(scene: Scene) -> tuple[str, str]:
    """JSON of a scene, and its numbers in base64. Lengths are parts of the size of the view, from its centre."""
    block, view = _Block(), scene.view
    size, centre = view.size or 1.0, view.centre
    found: dict[str, object] = {
        # From the start on: 32 bits tell no seconds from a start of years.
        "t": block.add(scene.t - scene.t[0]),
        "start": float(scene.t[0]),
        "count": scene.count,
        "names": [labels.shortened(name, labels.NAME) for name in scene.names],
        "units": [labels.shortened(unit, labels.UNIT) for unit in scene.units],
        "size": size,
        "centre": _list(centre),
        "view": {"towards": _list(view.towards), "up": _list(view.up), "flat": view.flat},
        "points": [block.add((track - centre) / size) for track in scene.points],
        "radii": _list(scene.radii / size),
        # As arrows: forces of any unit are no larger than 32 bits hold.
        "R": [block.add(track * (scene.scale / size)) for track in scene.R],
        "F": [block.add(track * (scene.scale / size)) for track in scene.F],
        "scale": scene.scale / size,
        "links": [_link(link, block, size) for link in scene.links],
        "surfaces": [_surface(one, block, size, centre) for one in scene.surfaces],
        "curves": [_curve(curve, block) for curve in scene.curves],
        "notes": [labels.shortened(note, labels.TITLE) for note in scene.notes],
        "modes": [_mode(mode, block, size, centre) for mode in scene.modes],
        "rate": scene.rate,
    }
    return json.dumps(found, allow_nan=False, separators=(",", ":")), block.text()


def _link(link: Link, block: _Block, size: float) -> dict[str, object]:
    told: dict[str, object] = {
        "kind": link.kind,
        "a": link.ends[0],
        "b": link.ends[1],
        "length": link.length / size,
    }
    return told if link.lengths is None else {**told, "lengths": block.add(link.lengths / size)}


def _surface(one: DrawnSurface, block: _Block, size: float, centre: Floats) -> dict[str, object]:
    frames = np.array(one.frames, dtype=np.float64)
    found: dict[str, object] = {"kind": one.kind, "oneSided": one.one_sided, "corners": []}
    if one.kind in ("line", "net"):
        # Their corners are points; an axis along which none of them moves stands there once.
        corners = (one.corners - centre) / size
        axes = [corners[..., axis] for axis in range(3)]
        found["places"] = [block.add(axis if np.ptp(axis, axis=0).any() else axis[:1]) for axis in axes]
        found["count"] = corners.shape[1]
    else:
        frames[:, 3] -= centre
        frames /= size
        # The polygon has the length of its corners, so its directions are of length 1.
        if one.kind == "plane":
            frames[:, :3] *= size
            found["corners"] = np.round(one.corners / size, 6).tolist()
    return found | {"frames": block.add(frames)}


def _curve(curve: TimeCurve, block: _Block) -> dict[str, object]:
    """A curve as parts of its largest value; what is no number stays none."""
    known = np.abs(curve.values[np.isfinite(curve.values)])
    largest = float(known.max(initial=0.0)) or 1.0
    name = labels.shortened(curve.name, labels.NAME)
    return {"name": name, "unit": largest, "values": block.add(curve.values / largest)}


def _mode(mode: Mode, block: _Block, size: float, centre: Floats) -> dict[str, object]:
    return {
        "name": labels.shortened(mode.name, labels.NAME),
        "note": labels.shortened(mode.note, labels.TITLE),
        "swings": mode.swings,
        "points": block.add((mode.points - centre) / size),
    }


def _list(values: Sequence[float] | Floats) -> list[float]:
    return [float(value) for value in values]
