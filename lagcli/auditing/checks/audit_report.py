"""The findings of an audit: checks, each with its worst entry and the limit of that, and how they are said."""

from __future__ import annotations

import dataclasses
import math
import operator
from collections.abc import Sequence
from typing import Any, Literal, NamedTuple

import numpy as np

from lagcli.auditing.evidence.autodiff import Array
from lagcli.auditing.evidence.differences import TENTH
from lagcli.auditing.evidence.table_input import WrittenDigits
from lagcli.model import notebook_html

Verdict = Literal["pass", "fail", "partly judged", "not judged", "nothing"]
NAMED = 12  # entries that a check names, the worst, and columns that none looks at
MOST_LISTED = 6  # entries of a check that fails, or rows, that a report names
# Of the entries must be judged before a check says `pass`: kinks may leave the rows around them open.
NEARLY_ALL = 0.9
MOTION = ("steps", "rates", "newton")  # checks that hold rows against their neighbours, at every row
FAR_APART = "cannot be judged at this spacing of rows"


@dataclasses.dataclass(frozen=True, slots=True)
class TableLocation:
    """One entry that a check looked at: the name of a row, particle or coordinate, the time, value and limit."""

    name: str
    t: float
    value: float
    limit: float

    def as_json(self) -> dict[str, object]:
        """The entry as it stands in the JSON; numbers that are not finite are null."""
        return {**dataclasses.asdict(self), "value": _finite(self.value), "limit": _finite(self.limit)}

    @property
    def ratio(self) -> float:
        if self.limit == 0:
            return np.inf if self.value else 0.0
        return self.value / self.limit


@dataclasses.dataclass(frozen=True, slots=True)
class Check:
    """One check. `worst` is the entry nearest to its limit or farthest beyond it; `failing` the worst entry of each
    name that is beyond, `failures` how many names are; `judged` of `entries` could be, for `pass` nearly all."""

    name: str
    law: str
    equation: str
    verdict: Verdict
    worst: TableLocation | None
    failing: tuple[TableLocation, ...] = ()
    failures: int = 0
    judged: int = 0
    entries: int = 0
    note: str = ""
    curve: tuple[tuple[float, float], ...] = ()

    @property
    def fraction(self) -> float | None:
        """The part of the entries that was judged; None where there are none."""
        return self.judged / self.entries if self.entries else None

    def as_json(self) -> dict[str, object]:
        """The check as it stands in the JSON; numbers that are not finite are null."""
        worst = None if self.worst is None else self.worst.as_json()
        own = {"worst": worst, "failing": [location.as_json() for location in self.failing]}
        names = "name law equation verdict worst failing failures judged entries fraction note".split()
        return {name: own[name] if name in own else getattr(self, name) for name in names}


@dataclasses.dataclass(frozen=True, slots=True)
class Audit:
    """The second opinion on a run; `passed` where no check fails. `figures`: numbers beside the checks; `unread`:
    columns that no check looked at; `complete`: whether a run that was made for it reached its end; `of_rest`: the rows
    are points of rest; `digits`: what is known of the error of the rows, where that was asked for; `written`,
    `written_events`: the digits of a rounded table, and of that of its incidents."""

    title: str
    path: str
    rows: int
    start: float
    end: float
    rtol: float
    atol: float
    checks: tuple[Check, ...]
    sentences: tuple[str, ...]
    notes: tuple[str, ...]
    figures: tuple[tuple[str, float], ...]
    unread: tuple[str, ...] = ()
    complete: bool = True
    of_rest: bool = False
    digits: dict[str, Any] | None = None
    written: WrittenDigits | None = None
    written_events: WrittenDigits | None = None

    def __repr__(self) -> str:
        verdict = "passed" if self.passed else "failed"
        checks = ", ".join(f"{check.name} {check.verdict}" for check in self.checks)
        return f"<Audit of {self.path}: {verdict}, {self.rows} rows; {checks}>"

    def _repr_html_(self) -> str:
        rows = [
            (
                check.name,
                check.law,
                check.verdict,
                "" if (worst := check.worst) is None else f"{worst.value:.3g} of {worst.limit:.3g}",
                "" if worst is None else f"{worst.name}, t = {worst.t:.6g}",
            )
            for check in self.checks
        ]
        return notebook_html.page(
            f"Audit of {self.title or self.path}",
            notebook_html.table(("check", "law", "verdict", "worst", "where"), rows),
            notebook_html.sentences([self.conclusion, *self.sentences, *self.notes]),
        )

    @property
    def passed(self) -> bool:
        """True if no check fails; what could not be judged is in `unjudged`."""
        return all(check.verdict != "fail" for check in self.checks)

    @property
    def unjudged(self) -> tuple[str, ...]:
        """Checks of which some entries or all could not be judged."""
        return tuple(check.name for check in self.checks if check.judged < check.entries)

    @property
    def conclusion(self) -> str:
        """The verdict of all checks, in a sentence."""
        failed = sum(check.verdict == "fail" for check in self.checks)
        if failed:
            word = "checks fail" if failed > 1 else "check fails"
            what = "does not hold points of rest" if self.of_rest else "is not a motion"
            return f"{failed} {word}: the table {what} of this model."
        thin = [check.name for check in self.checks if check.verdict in ("not judged", "partly judged")]
        if not thin:
            return "All checks passed."
        shown = [check for check in self.checks if check.name in MOTION]
        if sum(check.judged for check in shown) < TENTH * sum(check.entries for check in shown):
            return (
                "Nothing was found wrong, but almost nothing of the motion could be judged: the rows are too far"
                f" apart to show it. Not judged, or only in part: {', '.join(thin)}."
            )
        return f"All checks passed where they could judge. Not judged, or only in part: {', '.join(thin)}."

    def check(self, name: str) -> Check:
        """The check of a name. Raises `KeyError`."""
        return {check.name: check for check in reversed(self.checks)}[name]

    def as_json(self) -> dict[str, Any]:
        names = "title", "path", "passed", "conclusion", "complete", "rows", "start", "end", "rtol", "atol"
        return {
            **{name: getattr(self, name) for name in names},
            "checks": [check.as_json() for check in self.checks],
            "unjudged": list(self.unjudged),
            "unread": list(self.unread),
            "uniqueness": list(self.sentences),
            "figures": {name: _finite(number) for name, number in self.figures},
            "notes": list(self.notes),
            "written": None if self.written is None else self.written.as_json(),
            "written_events": None if self.written_events is None else self.written_events.as_json(),
            **({} if self.digits is None else {"accuracy": self.digits}),
        }


@dataclasses.dataclass(frozen=True, slots=True)
class Law:
    """The name of a check, the law it is about and its equation."""

    name: str
    law: str
    equation: str

    def unjudged(self, note: str, entries: int = 1) -> Check:
        """The check of which no entry can be judged."""
        return Check(self.name, self.law, self.equation, "not judged", None, entries=entries, note=note)

    def empty(self, note: str = "") -> Check:
        """The check that has nothing to look at."""
        return Check(self.name, self.law, self.equation, "nothing", None, note=note)


def judge(
    law: Law,
    names: Sequence[str],
    t: Array,
    residual: Array,
    limit: Array,
    judged: Array | None = None,
) -> Check:
    """Hold residuals (M, k) against limits (M, k) at the times t (M,); `judged` tells which can be decided. A residual
    that is no number is beyond every limit."""
    shape = residual.shape
    if not residual.size:
        return law.empty()
    size = np.where(np.isnan(residual), np.inf, np.abs(residual))
    limit = np.broadcast_to(limit, shape)
    decided = np.broadcast_to(True if judged is None else judged, shape) & ~np.isnan(limit)
    with np.errstate(divide="ignore", invalid="ignore"):
        ratio = np.where(size == 0, 0.0, size / limit)
    ratio = np.where(decided, ratio, -1.0)
    count = int(decided.sum())
    if not count:
        return law.unjudged(FAR_APART, residual.size)

    def location(i: int, j: int) -> TableLocation:
        return TableLocation(names[j], float(t[i]), float(size[i, j]), float(limit[i, j]))

    worst = np.unravel_index(int(np.argmax(ratio)), shape)
    rows, highest = np.argmax(ratio, axis=0), ratio.max(axis=0)
    beyond = [j for j in np.argsort(-highest, kind="stable").tolist() if highest[j] > 1.0]
    known = ratio.max(axis=1) >= 0
    return Check(
        law.name,
        law.law,
        law.equation,
        _verdict(bool(beyond), count, residual.size),
        location(int(worst[0]), int(worst[1])),
        failing=tuple(location(int(rows[j]), j) for j in beyond[:NAMED]),
        failures=len(beyond),
        judged=count,
        entries=residual.size,
        note=_note(count, residual.size),
        curve=tuple(zip(t[known].tolist(), ratio[known].max(axis=1).tolist(), strict=True)),
    )


def judge_parts(law: Law, names: Sequence[str], t: Array, *parts: tuple[Array, Array]) -> Check:
    """Hold residuals against limits, (M, k) each, of several parts side by side."""
    residual, limit = (np.concatenate(part, axis=1) for part in zip(*parts, strict=True))
    return judge(law, names, t, residual, limit)


def merged(parts: Sequence[Check], left_out: int = 0) -> Check:
    """The check merged from several of the same name; `left_out`: entries that none of them has looked at."""
    checked = [check for check in parts if check.verdict != "nothing"]
    entries = sum(check.entries for check in checked) + left_out
    judged = sum(check.judged for check in checked)
    if not entries:
        return parts[0]
    failing = sorted((location for check in checked for location in check.failing), key=_ratio, reverse=True)
    worst_of_name = {location.name: location for location in reversed(failing)}
    names = dict.fromkeys(location.name for location in failing)
    return dataclasses.replace(
        parts[0],
        verdict=_verdict(bool(names), judged, entries),
        worst=max((check.worst for check in checked if check.worst is not None), key=_ratio, default=None),
        failing=tuple(worst_of_name[name] for name in names)[:NAMED],
        failures=max(len(names), *(check.failures for check in parts)),
        judged=judged,
        entries=entries,
        note=_note(judged, entries),
        curve=tuple(sorted(location for check in checked for location in check.curve)),
    )


_ratio = operator.attrgetter("ratio")


def _verdict(fails: bool, judged: int, entries: int) -> Verdict:
    if fails:
        return "fail"
    if not judged:
        return "not judged"
    return "pass" if judged >= NEARLY_ALL * entries else "partly judged"


def _note(judged: int, entries: int) -> str:
    return f"{entries - judged} of {entries} entries cannot be judged" if judged < entries else ""


def _finite(number: float) -> float | None:
    return number if np.isfinite(number) else None


class AuditLines(NamedTuple):
    """The lines of an audit. rows: the table of checks, its headers first; failures: of each check that fails the head,
    the worst entries, and the number of others; sentences: those below, the verdict last."""

    rows: list[tuple[str, ...]]
    failures: list[tuple[str, list[str], int]]
    sentences: list[str]


def lines(audit: Audit) -> AuditLines:
    """All lines of an audit."""
    rows: list[tuple[str, ...]] = [("check", "equation", "worst", "limit", "verdict", "where")]
    failures: list[tuple[str, list[str], int]] = []
    for check in audit.checks:
        law, worst = f"{check.equation} ({check.law})" if check.law else check.equation, check.worst
        verdict: str = check.verdict
        if verdict == "partly judged" and check.fraction is not None:
            verdict = f"{max(1, math.floor(100 * check.fraction))} % judged"
        if worst is None:
            rows.append((check.name, law, "-", "-", verdict, "-"))
        else:
            # An entry over a window names its times itself
            time = "" if " over t = " in worst.name else f", t = {worst.t:.6g}"
            where = f"{worst.name}{time}" if worst.value else "-"
            rows.append((check.name, law, f"{worst.value:.1e}", f"{worst.limit:.1e}", verdict, where))
        if verdict == "fail":
            about = f" ({check.law}: {check.equation})" if check.law else ""
            shown = check.failing[:MOST_LISTED]
            faults = [
                f"{at.name} at t = {at.t:.9g}: {at.value:.3g}, the limit is {at.limit:.3g}" for at in shown
            ]
            others = max(0, check.failures - MOST_LISTED)
            failures.append((f"{check.name} fails{about}:", faults, others))
    sentences = [f"{sentence[0].upper()}{sentence[1:]}." for sentence in audit.sentences]
    if audit.figures:
        figures = dict(audit.figures)
        real = figures["work_of_constraints"]
        real_work = f"{real:.10g}" if math.isfinite(real) else "not known (the rows are too far apart)"
        sentences.append(
            f"Virtual work of R at most {figures['virtual_work']:.1e}; real work of R {real_work}, energy gained"
            f" {figures['energy_gained']:.10g}."
        )
    if audit.unread:
        more = f" and {len(audit.unread) - NAMED} others" if len(audit.unread) > NAMED else ""
        sentences.append(f"Columns that no check looks at: {', '.join(audit.unread[:NAMED])}{more}.")
    for table, written in (("table", audit.written), ("table of events", audit.written_events)):
        if written is not None:
            sentences.append(written.sentence(table))
    return AuditLines(rows, failures, [*sentences, audit.conclusion])
