"""The page of an animation: one HTML file with three.js, the scene as JSON and its arrays as one block of 32-bit floats
in base64. One instant is a drawing in SVG: for a report, a printer, or a browser that draws nothing else."""

from __future__ import annotations

import base64
import hashlib
import html
import json
import pathlib
import string

import numpy as np
import numpy.typing as npt

from lagcli import __version__, memory
from lagcli.arrays import Floats
from lagcli.output.animation import nets
from lagcli.output.animation.scene import DrawnSurface, Scene, at_instant
from lagcli.output.figures import labels
from lagcli.output.files import atomic_file

ASSETS = pathlib.Path(__file__).with_name("assets")
LIBRARY = "three-0.180.0.min.js"
MOST_BYTES = 2_000_000  # of a page, so that it can be sent by mail and opens at once
PALETTE = ("#0072b2", "#d55e00", "#009e73", "#cc79a7", "#e69f00", "#56b4e9", "#8a6d00", "#7b5ea7")
MANY = "#3f7fb5"  # of particles, when there are more than colours
ROUND = 48  # corners of a circle
MARGIN = 0.08  # of the picture
# A point of so many scenes is drawn no finer: the drawing stands in every page.
MOST_DRAWN = 2000


def text(scene: Scene) -> str:
    """The page. All text of the model is escaped, and the policy of the page allows only its own two scripts."""
    title = html.escape(labels.shortened(scene.title, labels.TITLE))
    data, numbers = packed(scene)
    for letter in "<>&\u2028\u2029":  # JSON cannot end the tag that it stands in, nor begin a comment there
        data = data.replace(letter, f"\\u{ord(letter):04x}")
    library, page, css = (_asset(name) for name in (LIBRARY, "page.js", "page.css"))
    return string.Template(_asset("page.html")).substitute(
        TITLE=title,
        VERSION=html.escape(__version__),
        SCRIPTS=f"{_hash(library)} {_hash(page)}",
        STYLES=_hash(css),
        CSS=css,
        STILL=svg(scene),
        SCENE=data,
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


@memory.remembered()
def _asset(name: str) -> str:
    return (ASSETS / name).read_text(encoding="utf-8")


def _hash(content: str) -> str:
    digest = hashlib.sha256(content.encode("utf-8")).digest()
    return f"'sha256-{base64.b64encode(digest).decode('ascii')}'"


class _Block:
    """Numbers one after another; equal arrays stand there once."""

    def __init__(self) -> None:
        self.parts: list[npt.NDArray[np.float32]] = []
        self._known: dict[bytes, list[int]] = {}
        self._size = 0

    def add(self, values: Floats) -> list[int]:
        """The offset of an array and its length."""
        flat = np.ascontiguousarray(values, dtype="<f4").ravel()
        key = flat.tobytes()
        if key not in self._known:
            self._known[key] = [self._size, flat.size]
            self.parts.append(flat)
            self._size += flat.size
        return self._known[key]


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
        "centre": centre.tolist(),
        "view": {"towards": view.towards.tolist(), "up": view.up.tolist(), "flat": view.flat},
        "points": [block.add((track - centre) / size) for track in scene.points],
        "radii": (scene.radii / size).tolist(),
        # As arrows: forces of any unit are no larger than 32 bits hold.
        "R": [block.add(track * (scene.scale / size)) for track in scene.R],
        "F": [block.add(track * (scene.scale / size)) for track in scene.F],
        "scale": scene.scale / size,
        "links": [
            {"kind": link.kind, "a": link.ends[0], "b": link.ends[1], "length": link.length / size}
            | ({} if link.lengths is None else {"lengths": block.add(link.lengths / size)})
            for link in scene.links
        ],
        "surfaces": [_surface(one, block, size, centre) for one in scene.surfaces],
        "curves": [_curve(name, values, block) for name, values in scene.curves.items()],
        "notes": [labels.shortened(note, labels.TITLE) for note in scene.notes],
        "modes": [
            {
                "name": labels.shortened(mode.name, labels.NAME),
                "note": labels.shortened(mode.note, labels.TITLE),
                "swings": mode.swings,
                "points": block.add((mode.points - centre) / size),
            }
            for mode in scene.modes
        ],
        "rate": scene.rate,
    }
    numbers = base64.b64encode(b"".join(part.tobytes() for part in block.parts)).decode("ascii")
    return json.dumps(found, allow_nan=False, separators=(",", ":")), numbers


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


def _curve(name: str, values: Floats, block: _Block) -> dict[str, object]:
    """A curve as parts of its largest value; what is no number stays none."""
    known = np.abs(values[np.isfinite(values)])
    largest = float(known.max(initial=0.0)) or 1.0
    name = labels.shortened(name, labels.NAME)
    return {"name": name, "unit": largest, "values": block.add(values / largest)}


class Projection:
    """Corners to coordinates of a picture of this width and height, x to the right and y down."""

    def __init__(self, scene: Scene, width: float, height: float) -> None:
        view = scene.view
        self._right = np.cross(view.up, view.towards)
        self._right = self._right / np.linalg.norm(self._right)
        self._above = np.cross(view.towards, self._right)
        near = 3 * view.size  # a floor may reach far beyond what moves on it
        rims = [outline(one, 0) for one in scene.surfaces]
        seen = [rim for rim in rims if np.linalg.norm(rim - view.centre, axis=1).max(initial=0.0) < near]
        flat = np.concatenate([self._plane(track) for track in (*scene.points, *seen)])
        low, high = flat.min(axis=0), flat.max(axis=0)
        extent = np.maximum(high - low, 1e-9 * max(view.size, 1e-300))
        pad = 0.05 * float(np.linalg.norm(extent))
        room = np.array([width, height]) * (1 - 2 * MARGIN)
        self.scale = float((room / (extent + 2 * pad)).min())
        self._middle, self._centre = (low + high) / 2, np.array([width, height]) / 2

    def __call__(self, corners: Floats) -> Floats:
        """(k, 3) to (k, 2)."""
        return np.asarray(
            self._centre + (self._plane(corners) - self._middle) * self.scale * np.array([1.0, -1.0])
        )

    def _plane(self, corners: Floats) -> Floats:
        return np.stack([corners @ self._right, corners @ self._above], axis=-1)


def outline(one: DrawnSurface, frame: int) -> Floats:
    """Corners (k, 3) of the outline of a surface at an instant."""
    if one.kind in ("line", "net"):
        corners = one.corners_at(frame)
        return nets.triangles(corners) if one.kind == "net" else corners[np.isfinite(corners).all(axis=-1)]
    u, v, w, origin = at_instant(one.frames, frame)
    if one.kind == "plane":
        closed = np.concatenate([one.corners, one.corners[:1]])
        return np.asarray(origin + closed @ np.array([u, v, w]))
    angle = np.linspace(0, 2 * np.pi, ROUND + 1)[:, None]
    turns = {"circle": ((u, v),), "cylinder": ((u, v),), "sphere": ((u, v), (v, w), (w, u))}[one.kind]
    rings = [origin + np.cos(angle) * a + np.sin(angle) * b for a, b in turns]
    if one.kind == "cylinder":
        rings = [rings[0] - w, rings[0] + w]
    return np.concatenate(rings)


def colour(number: int, count: int) -> str:
    """The colour of a particle."""
    return MANY if count > len(PALETTE) else PALETTE[number % len(PALETTE)]


def svg(scene: Scene, frame: int = 0, width: int = 640, height: int = 480) -> str:
    """The drawing as an element `svg` that stands in HTML; the title is escaped."""
    to = Projection(scene, width, height)
    title = html.escape(labels.shortened(scene.title, labels.TITLE))
    lines = [
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {width} {height}" role="img"'
        f' preserveAspectRatio="xMidYMid meet"><title>{title}</title>'
    ]
    for one in scene.surfaces:
        rim = outline(one, frame)
        look = 'fill="#6f9fcf" fill-opacity="0.15"' if one.kind in ("plane", "net") else 'fill="none"'
        corners = {"net": 3, "sphere": ROUND + 1, "cylinder": ROUND + 1}.get(one.kind)
        pieces = [rim] if corners is None else rim.reshape(-1, corners, 3)
        stroke = ' stroke="#6c7885"' * (one.kind != "net")
        lines += [_path(to(piece), look + stroke) for piece in pieces]
    for link in scene.links[:MOST_DRAWN]:
        ends = to(np.array([scene.at(end, frame) for end in link.ends]))
        dash = "" if link.kind == "rod" else ' stroke-dasharray="4 3"'
        lines.append(_path(ends, f'fill="none" stroke="#6c7885" stroke-width="2"{dash}'))
    for k in range(min(scene.count, MOST_DRAWN)):
        x, y = to(scene.at(k, frame)[None])[0]
        radius = max(1.5, float(scene.radii[k]) * to.scale)
        lines.append(f'<circle cx="{x:.1f}" cy="{y:.1f}" r="{radius:.1f}" fill="{colour(k, scene.count)}"/>')
    return "".join([*lines, "</svg>"])


def _path(points: Floats, attributes: str) -> str:
    joined = "L".join(f"{x:.1f} {y:.1f}" for x, y in points)
    return f'<path d="M{joined}" {attributes}/>'
