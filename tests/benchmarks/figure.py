"""The figure of the page: for each motion the time of a solution by its error."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from matplotlib import figure as mpl

from . import page

# Color, mark and line of each program.
STYLES = {
    "plain": ("#1b6ca8", "o", "--"),
    "native": ("#1b6ca8", "o", "-"),
    "heyoka": ("#c05746", "s", "-"),
    "heyoka-compact": ("#c05746", "s", "--"),
    "cvodes": ("#5a8f4e", "^", "-"),
    "tsit5": ("#8a6bb0", "D", "--"),
    "dopri8": ("#8a6bb0", "D", "-"),
    "mujoco": ("#b08d57", "v", "-"),
    "scipy": ("0.5", "x", "-"),
}
COLUMNS = 4
FINEST = 1e-14  # smaller errors are drawn there


def write(path: Path, results: dict[str, Any]) -> None:
    """Draw what has been measured."""
    motions = [*results.get("contest", {}).values()]
    if not motions:
        return
    rows = -(-len(motions) // COLUMNS)
    paper = mpl.Figure(figsize=(3.6 * COLUMNS, 3.4 * rows + 0.6), layout="constrained", dpi=110)
    panels = paper.subplots(rows, COLUMNS, squeeze=False).ravel()
    seen: dict[str, Any] = {}
    for panel, case in zip(panels, motions, strict=False):
        for key, answer in case["answers"].items():
            color, mark, line = STYLES[key]
            # Settings that come no nearer than a looser one are left out.
            points, least = [], float("inf")
            for each in answer["attempts"]:
                if each["error"] is not None and each["error"] < least:
                    least = each["error"]
                    points.append((max(least, FINEST), each["seconds"]))
            style = {"color": color, "marker": mark, "linestyle": line, "markersize": 3.5, "linewidth": 1.1}
            (seen[key],) = panel.loglog(*zip(*points, strict=True), **style)
        panel.set(
            title=f"{case['case']}, {case['duration']:g} s", xlabel="error at the end", ylabel="time, s"
        )
        panel.set_xlim(1, FINEST / 2)
        panel.spines[["top", "right"]].set_visible(False)
        panel.grid(True, which="major", linewidth=0.4, alpha=0.5)
    for panel in panels[len(motions) :]:
        panel.set_axis_off()
    keys = [key for key in STYLES if key in seen]
    names = [page.NAMES[key] for key in keys]
    paper.legend([seen[key] for key in keys], names, frameon=False, loc="outside lower center", ncols=5)
    paper.savefig(path)
