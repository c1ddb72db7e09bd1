"""The pages of `lagcli explain`: what each diagnostic code means, why it is given, an example and how to fix it.

One file a code, `pages/CODE.toml`; the sentence that names the spot in a user's file is worded where it is found.
A page has the keys

- `meaning`, `why`, `fix`: sentences; line breaks in them count as spaces.
- `example`: a model that gives this code and no other error; `old` a part of it, and `new` what fixes it.
- `severity`: "error" unless it is a "warning" or "note" of a model, or the "stop" of a run.
- `stage`: where the code arises: while the model is "read" (unless another is given), at the "start" of a count or
  run, in a "run", or from an "input" that is no text (a directory, a huge file); then the example is what was typed.
"""

from __future__ import annotations

import dataclasses
import functools
import pathlib
import re
import textwrap
import tomllib
from typing import Literal

from lagcli import memory
from lagcli.errors import diagnostics

Stage = Literal["input", "read", "start", "run"]
Severity = diagnostics.Severity | Literal["stop"]

FOLDER = pathlib.Path(__file__).parent / "pages"
WIDTH = 100  # columns of a page of `explain`
SENTENCES = ("meaning", "why", "fix")


@dataclasses.dataclass(frozen=True, slots=True)
class Page:
    """A diagnostic code at length; the keys are those of its file."""

    code: str
    meaning: str
    why: str
    example: str
    fix: str
    old: str = ""
    new: str = ""
    severity: Severity = "error"
    stage: Stage = "read"

    @property
    def fixed(self) -> str:
        """The example after the fix."""
        return self.example.replace(self.old, self.new, 1) if self.old else self.new or self.example

    @property
    def fixed_lines(self) -> tuple[str, ...]:
        """The lines of the fixed example that the example does not have."""
        written = self.example.splitlines()
        return tuple(line for line in self.fixed.splitlines() if line not in written)


def page(code: str) -> Page | None:
    """The page of a code, or None where there is no such code."""
    return _read(code) if code in codes() else None


@functools.cache
def codes() -> tuple[str, ...]:
    """All codes, in the order of the alphabet."""
    return tuple(sorted(path.stem for path in FOLDER.glob("*.toml")))


def lines(columns: int | None = None) -> list[str]:
    """All codes, each with its meaning on the same line, and with its severity where that is not an error.

    columns: where lines are folded.
    """
    width = max(map(len, codes())) + 2
    found = []
    for code in codes():
        one = _read(code)
        line = f"{code:{width}}" + ("" if one.severity == "error" else f"({one.severity}) ") + one.meaning
        whole = [line] if columns is None else textwrap.wrap(line, columns, subsequent_indent=" " * width)
        found.append("\n".join(whole))
    return found


def render(page: Page) -> str:
    """A page as plain text."""
    parts = [
        f"{page.severity}[{page.code}]",
        textwrap.fill(page.meaning, WIDTH),
        "Why:\n" + textwrap.fill(page.why, WIDTH, initial_indent="  ", subsequent_indent="  "),
        "Example:\n" + textwrap.indent(page.example.rstrip() or "(an empty file)", "    "),
        "Fix:\n" + textwrap.fill(page.fix, WIDTH, initial_indent="  ", subsequent_indent="  "),
    ]
    if page.fixed_lines:
        parts.append(textwrap.indent("\n".join(page.fixed_lines), "    "))
    return "\n\n".join(parts)


@memory.remembered()
def _read(code: str) -> Page:
    keys = tomllib.loads((FOLDER / f"{code}.toml").read_text(encoding="utf-8"))
    return Page(code, **keys | {key: " ".join(keys[key].split()) for key in SENTENCES})


TEXT = (
    "(D.n) number the equations of the text this program follows, an appendix on Lagrange multipliers for constrained"
    " mechanics after Ray and Shamanna (Eur. J. Phys. 27 (2006) 311, arXiv physics/0510204v2) and Goldstein"
    " (Classical Mechanics, chapters 1 and 2)."
)
_COMPONENTS = "A step to (D.22): the 3N components x_n are split into C dependent and 3N - C independent ones"
_IDENTITY = "A step in the proof of (D.31)"

LINES: dict[int, str] = {
    1: "A holonomic constraint: f_i(r, t) = 0, a surface in the space of all positions.",
    2: "All s holonomic constraints; each independent one takes one degree of freedom: 3N - s are left.",
    3: "A differential constraint: sum_k A_ik . dr_k + A_it dt = 0, with coefficients of positions and time.",
    4: "The same in velocities: sum_k A_ik . v_k + A_it = 0.",
    5: "A holonomic constraint differentiated: sum_k grad_k f_i . dr_k + df_i/dt dt = 0.",
    6: "All C = s + m rows in one shape: sum_k B_ik . dr_k + B_it dt = 0; with velocities B v + b = 0.",
    7: "What B is: A_ik and A_it for differential rows, grad_k f_i and df_i/dt for holonomic ones.",
    8: "A virtual displacement is the difference of two allowed displacements over the same dt.",
    9: "Virtual displacements satisfy sum_k B_ik . delta r_k = 0; the term in dt is gone.",
    10: "Newton's law: m_k a_k = F_k + R_k, applied forces and constraint forces.",
    11: "Ideal constraints do no virtual work: sum_k R_k . delta r_k = 0.",
    12: "Two particles tied to each other: their virtual work vanishes in the sum, not for each.",
    13: "A step to (D.22): each row of (D.9) is multiplied by a number lambda_i still to be found.",
    14: "A step to (D.22): the multiplied rows are added up; the sum vanishes.",
    15: "A step to (D.22): that sum is taken from the virtual work (D.11).",
    16: f"{_COMPONENTS}: the components get one index n = 3(k - 1) + j.",
    17: f"{_COMPONENTS}: the virtual work in these components.",
    18: f"{_COMPONENTS}: the rows in these components.",
    19: f"{_COMPONENTS}: lambda_i makes the brackets of the dependent ones vanish; the rows must be independent.",
    20: f"{_COMPONENTS}: the sum over the independent ones is left.",
    21: f"{_COMPONENTS}: as these are free, each of their brackets vanishes too.",
    22: "The constraint force: R_k = sum_i lambda_i B_ik; with matrices R = B^T lambda.",
    23: "Newton's law with multipliers: m_k a_k = F_k + sum_i lambda_i B_ik.",
    24: "The whole system for r, v and lambda: (D.23), dr/dt = v and B v + b = 0, 6N + C equations. The motion is"
    " unique from a consistent start, where rows are independent and forces and rows are Lipschitz.",
    25: "The recipe in general: a sum that vanishes, rows that vanish, multipliers, and all brackets are zero.",
    26: "D'Alembert's principle: sum_k (m_k a_k - F_k) . delta r_k = 0 for all virtual displacements.",
    27: "Generalized coordinates: positions as functions of them, x_n = x_n(q, t).",
    28: "Virtual displacements by them: delta r_k = sum_j (dr_k/dq_j) delta q_j.",
    29: "The virtual work of the applied forces, written with delta q_j.",
    30: "Generalized forces: Q_j = sum_k F_k . dr_k/dq_j.",
    31: "The identity behind Lagrange's equations: sum_k m_k a_k . dr_k/dq_j = d/dt(dT/dq'_j) - dT/dq_j.",
    32: "A step to (D.34): d'Alembert's principle with (D.30) and (D.31) put in.",
    33: "A step to (D.34): the delta q_j are independent, so each bracket vanishes.",
    34: "Lagrange's equations with forces: d/dt(dT/dq'_j) - dT/dq_j = Q_j.",
    35: "A force with a potential: F_k = -grad_k V.",
    36: "The Lagrangian L = T - V and the forces it stands for: a step to (D.39).",
    37: "A step to (D.39): the generalized force of a potential is Q_j = -dV/dq_j.",
    38: "A step to (D.39): V does not depend on the rates.",
    39: "Lagrange's equations: d/dt(dL/dq'_j) - dL/dq_j = 0.",
    **{
        n: f"{_IDENTITY}: {what}"
        for n, what in enumerate(
            (
                "the velocity of a particle by the rates q'_j.",
                "dv_k/dq'_j = dr_k/dq_j.",
                "the time derivative of dr_k/dq_j is dv_k/dq_j.",
                "the kinetic energy T = sum_k m_k v_k^2 / 2.",
                "its slope by a coordinate.",
                "its slope by a rate.",
                "the time derivative of that.",
                "the product rule.",
                "the terms put together.",
            ),
            40,
        )
    },
    49: "Hamilton's principle: the integral of L dt is stationary among motions with the same ends.",
    50: "A step from (D.49) to (D.39): the variation of the integral.",
    51: "A step from (D.49) to (D.39): integration by parts, with the ends fixed.",
    52: "Rows in generalized coordinates: sum_n A_in delta q_n = 0, with multipliers.",
    53: "Lagrange's equations with multipliers: d/dt(dL/dq'_n) - dL/dq_n = sum_i lambda_i A_in.",
}
LAST = max(LINES)


def line(code: str) -> str | None:
    """The line of an equation named `D.24` or `(D.24)`; None for another text. Raises `ValueError` for no equation."""
    found = re.fullmatch(r"\(?[Dd]\.(\d{1,3})\)?", code.strip())
    if found is None:
        return None
    if int(found[1]) not in LINES:
        raise ValueError(f"there is no equation (D.{found[1]})")
    return f"(D.{found[1]}) {LINES[int(found[1])]}"
