"""The figure of an audit: every check over time, as a part of its limit."""

import numpy as np
from matplotlib import axes, figure

from lagcli.auditing.checks.audit_report import Audit, Check
from lagcli.output.figures import figure_page, labels

_BLUE, _RED, _GREY = "#0072B2", "#D55E00", "#888888"
_HEIGHT, _FLOOR = 0.62, 1e-9  # inches of one check; what is below that part of its limit is drawn there


def compose(found: Audit, unit: str = "s") -> figure.Figure:
    """The figure of an audit: one strip for each check, on a logarithmic scale with the limit at 1.

    ``unit``: the label of time.
    """
    checks = [check for check in found.checks if check.entries and (check.law or check.verdict == "fail")]
    with figure_page.style():
        verdict = found.conclusion.partition(".")[0].partition(":")[0].partition(",")[0]
        title = f"Audit of {labels.shortened(found.title or found.path, labels.NAME)}: {verdict}"
        drawn = figure_page.sheet(title, 1.1 + _HEIGHT * len(checks))
        strips = drawn.subplots(len(checks), 1, sharex=True, squeeze=False)[:, 0]
        for strip, check in zip(strips, checks, strict=True):
            colour = {"fail": _RED, "pass": _BLUE}.get(check.verdict, _GREY)
            strip.set_yscale("log")
            strip.axhline(1.0, color=_GREY, linewidth=0.8, linestyle=(0, (4, 3)))
            _curve(strip, check, colour)
            strip.set_ylim(
                _FLOOR / 3, max(30.0, *(3 * part for _, part in check.curve if np.isfinite(part)), 30.0)
            )
            strip.set_yticks([1e-8, 1e-4, 1.0], ["1e−8", "1e−4", "1"])
            strip.tick_params(labelsize=6)
            label = check.name if check.verdict == "pass" else f"{check.name}\n({check.verdict})"
            strip.set_ylabel(label, fontsize=7, rotation=0, ha="right", va="center", color=colour, labelpad=8)
            strip.set_xlim(found.start, found.end if found.end > found.start else found.start + 1)
        strips[-1].set_xlabel(
            f"t ({labels.shortened(unit, labels.UNIT)})     (each curve: worst value as a part of its limit, dashed)",
            fontsize=8,
        )
        return drawn


def _curve(strip: axes.Axes, check: Check, colour: str) -> None:
    if not check.curve:
        return
    t, part = np.array(check.curve).T
    # Not a number: a gap between the stretches of a check that looks at windows.
    part = np.clip(np.where(np.isposinf(part), 1e12, part), _FLOOR, 1e12)
    strip.plot(t, part, color=colour, linewidth=0.9, marker="o" if len(t) == 1 else None, markersize=3)
