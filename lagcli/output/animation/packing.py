"""A scene as JSON and one block of numbers: 32-bit floats in base64, each array named by its place and its length."""

from __future__ import annotations

import base64
import json
from collections.abc import Sequence

import numpy as np
import numpy.typing as npt

from lagcli.output.animation.scene import DrawnSurface, Mode, Scene, TimeCurve
from lagcli.output.figures import labels

Floats = npt.NDArray[np.float64]
# Seconds on the clock of who watches: a run whose time is in seconds and lasts no longer than `WATCHABLE` keeps its own
# time if it lasts `SHORT` at least, any other is shown within `SHOWN`.
SHORT, WATCHABLE, SHOWN = 2.0, 40.0, 10.0


class _Block:
    """Numbers one after another; equal arrays stand there once."""

    def __init__(self) -> None:
        self._parts: list[npt.NDArray[np.float32]] = []
        self._known: dict[bytes, list[int]] = {}
        self._size = 0

    def add(self, values: Floats) -> list[int]:
        """The place of an array and its length."""
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
        "links": [
            {"kind": link.kind, "a": link.ends[0], "b": link.ends[1], "length": link.length / size}
            for link in scene.links
        ],
        "surfaces": [_surface(one, block, size, centre) for one in scene.surfaces],
        "curves": [_curve(curve, block) for curve in scene.curves],
        "notes": [labels.shortened(note, labels.TITLE) for note in scene.notes],
        "modes": [_mode(mode, block, size, centre) for mode in scene.modes],
        "rate": rate(scene),
    }
    return json.dumps(found, allow_nan=False, separators=(",", ":")), block.text()


def _surface(one: DrawnSurface, block: _Block, size: float, centre: Floats) -> dict[str, object]:
    frames = np.array(one.frames, dtype=np.float64)
    found: dict[str, object] = {"kind": one.kind, "oneSided": one.one_sided, "corners": []}
    if one.kind in ("line", "net"):
        # Their corners are places; an axis along which none of them moves stands there once.
        places = (one.corners - centre) / size
        axes = [places[..., axis] for axis in range(3)]
        found["places"] = [block.add(axis if np.ptp(axis, axis=0).any() else axis[:1]) for axis in axes]
        found["count"] = places.shape[1]
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


def rate(scene: Scene) -> float:
    """Units of the time of the run in a second of who watches."""
    span = float(scene.t[-1] - scene.t[0])
    if not scene.modes and scene.units[0].strip() == "s" and SHORT <= span <= WATCHABLE:
        return 1.0
    return span / SHOWN if not scene.modes else span / SHORT


def _list(values: Sequence[float] | Floats) -> list[float]:
    return [float(value) for value in values]
