"""One instant of a scene as a drawing in SVG: for a report, a printer, or a browser that draws nothing else."""

from __future__ import annotations

import html

import numpy as np
import numpy.typing as npt

from lagcli.output.animation import nets
from lagcli.output.animation.scene import DrawnSurface, Scene
from lagcli.output.figures import labels

Floats = npt.NDArray[np.float64]
PALETTE = ("#0072b2", "#d55e00", "#009e73", "#cc79a7", "#e69f00", "#56b4e9", "#8a6d00", "#7b5ea7")
MANY = "#3f7fb5"  # of particles, when there are more than colours
ROUND = 48  # corners of a circle
MARGIN = 0.08  # of the picture
# A point of so many scenes is drawn no finer: the drawing stands in every page.
MOST_DRAWN = 2000


class Projection:
    """Corners to coordinates of a picture of this width and height, x to the right and y down."""

    def __init__(self, scene: Scene, width: float, height: float) -> None:
        view = scene.view
        self._right = np.cross(view.up, view.towards)
        self._right = self._right / np.linalg.norm(self._right)
        self._above = np.cross(view.towards, self._right)
        everything = [track for track in scene.points if len(track)]
        near = 3 * view.size  # a floor may reach far beyond what moves on it
        rims = [outline(one, 0) for one in scene.surfaces]
        everything += [
            rim for rim in rims if np.linalg.norm(rim - view.centre, axis=1).max(initial=0.0) < near
        ]
        flat = (
            np.concatenate([self._plane(track) for track in everything]) if everything else np.zeros((1, 2))
        )
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
    u, v, w, origin = one.frames[min(frame, len(one.frames) - 1)]
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
        rim, filled = outline(one, frame), one.kind == "plane"
        look = 'fill="#6f9fcf" fill-opacity="0.15"' if filled else 'fill="none"'
        if one.kind == "net":
            pieces = list(rim.reshape(-1, 3, 3))
            lines += [_path(to(piece), 'fill="#6f9fcf" fill-opacity="0.15"') for piece in pieces]
            continue
        pieces = np.split(rim, len(rim) // (ROUND + 1)) if one.kind in ("sphere", "cylinder") else [rim]
        lines += [_path(to(piece), f'{look} stroke="#6c7885"') for piece in pieces]
    for link in scene.links[:MOST_DRAWN]:
        ends = to(np.array([scene.at(link.ends[0], frame), scene.at(link.ends[1], frame)]))
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
