"""The figure of the page: cost of a step by links, and time of the solution by program."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from matplotlib import figure as mpl

from . import page

COLORS = {
    "lagcli": "#1b6ca8",
    "exudyn": "#c05746",
    "cvodes": "#5a8f4e",
    "sympy": "#8a6bb0",
    "lagranges-method": "#b08d57",
}
MARKS = {"lagcli": "o", "exudyn": "s", "cvodes": "^", "sympy": "D", "lagranges-method": "v"}


def write(path: Path, results: dict[str, Any]) -> None:
    """Draw what has been measured."""
    drawn = [name for name in ("steps", "contest") if results.get(name)]
    if not drawn:
        return
    paper = mpl.Figure(figsize=(5.2 * len(drawn), 4.6), layout="constrained", dpi=120)
    panels = paper.subplots(1, len(drawn), squeeze=False)[0]
    for panel, name in zip(panels, drawn, strict=True):
        (_steps if name == "steps" else _contest)(panel, results)
        panel.spines[["top", "right"]].set_visible(False)
        panel.grid(True, which="major", linewidth=0.4, alpha=0.5)
    paper.savefig(path)


def _steps(panel: Any, results: dict[str, Any]) -> None:
    lines = [line for line in results["steps"] if line["rod"] == "distance"]
    others = [line for line in results["steps"] if line["rod"] == "square"]
    for chosen, key, label, style in (
        (others, "yardstick_step", "yardstick", {"color": "0.4", "marker": "x", "linestyle": "--"}),
        (others, "step", "lagcli, rods as dot", {"color": COLORS["lagcli"], "marker": "o"}),
        (lines, "step", "lagcli, rods as distance", {"color": "#63a6d8", "marker": "o"}),
    ):
        links = [line["links"] for line in chosen]
        panel.semilogx(links, [line[key] / line["links"] * 1e6 for line in chosen], label=label, **style)
    panel.set(xlabel="links", ylabel="a step, µs a link", title="One step of order 8", ylim=(0, None))
    panel.legend(frameon=False, fontsize=8, loc="upper center", bbox_to_anchor=(0.5, -0.17), ncols=3)


def _contest(panel: Any, results: dict[str, Any]) -> None:
    """Each motion has a line of its own; hollow marks did not reach the wanted error."""
    motions = results["contest"]
    seen = set()
    for place, case in enumerate(motions):
        for key, answer in case["answers"].items():
            if "solve_seconds" not in answer:
                continue
            fill = COLORS[key] if answer["reached"] else "none"
            label = page.NAMES[key] if key not in seen else None
            panel.scatter(
                answer["solve_seconds"],
                place,
                marker=MARKS[key],
                color=COLORS[key],
                facecolor=fill,
                label=label,
                zorder=3,
            )
            seen.add(key)
    panel.set_xscale("log")
    panel.set_yticks(range(len(motions)), [case["case"] for case in motions])
    panel.set_ylim(len(motions) - 0.4, -0.6)
    wanted = f"{motions[0]['wanted']:.0e}".replace("e-0", "e-")
    panel.set(
        xlabel="time of the solution, s; hollow: error not reached",
        title=f"Solution to an error of {wanted}",
    )
    panel.legend(frameon=False, fontsize=8, loc="upper center", bbox_to_anchor=(0.4, -0.17), ncols=3)
