"""A derivation as a page: sections of numbered lines, in every format."""

from __future__ import annotations

import dataclasses
import html
import itertools
from collections.abc import Callable, Iterator

import sympy

from lagcli.derivation.symbolic.symbolic_system import Symbolic
from lagcli.derivation.writing import formula as f
from lagcli.derivation.writing import render_latex, render_mathml, render_text
from lagcli.output import latex_text

WIDTH = 100  # columns where there is no terminal
# Sides wider than this do not push the others of their section to the right.
WIDEST_LEFT = 22
# Characters of a formula after which LaTeX and MathML begin a new line.
LONG = 90

# Of the rows in which a formula goes on.
_INDENT = r"\quad "

_STYLE = """
body { font-family: Georgia, "Times New Roman", serif; color: #222; max-width: 62em;
  margin: 2em auto; padding: 0 1em; }
h1 { font-size: 1.5em; margin-bottom: .2em; } h2 { font-size: 1.1em; margin: 1.6em 0 .4em; }
table { border-collapse: collapse; width: 100%; }
td { padding: .35em .3em; vertical-align: middle; }
td.left { text-align: right; white-space: nowrap; width: 12em; }
td.number { text-align: right; color: #777; white-space: nowrap; }
td.note { color: #555; font-style: italic; }
math { font-size: 1.08em; } mover > mo { font-size: 1.5em; } .vector { font-weight: bold; }
p.about { color: #555; margin: 0; }
""".strip()


@dataclasses.dataclass(frozen=True, slots=True)
class Line:
    """`sides` joined by `=` or by `signs`, with the `number` of the equation of the text; or a `note` in words.

    `number` is empty for what the text does not number. A line with sides may have a note too. `kind` and `family`
    group lines of which only some are shown.
    """

    number: str = ""
    sides: tuple[f.FormulaNode, ...] = ()
    note: str = ""
    kind: str = ""
    family: str = ""
    signs: tuple[str, ...] = ()

    @property
    def relations(self) -> tuple[str, ...]:
        """The signs between the sides: `=`, `≤`, `≥` or `⊥`."""
        return self.signs or ("=",) * (len(self.sides) - 1)

    def joined(
        self, first: int, written: Callable[[f.FormulaNode], str], relation: Callable[[str], str] = str
    ) -> str:
        """The sides from a number on with the signs between them."""
        parts = [written(side) for side in self.sides[first:]]
        signs = map(relation, self.relations[first:])
        return "".join(
            [*parts[:1], *(f" {sign} {part}" for sign, part in zip(signs, parts[1:], strict=True))]
        )


@dataclasses.dataclass(frozen=True, slots=True)
class Section:
    """Lines under a title."""

    title: str
    lines: tuple[Line, ...]


@dataclasses.dataclass(frozen=True, slots=True)
class Derivation:
    """The equations of motion of a model, to be read (`text`, `latex`, `markdown`, `html`), or to be worked with.

    `system` holds them in SymPy symbols; `equations()` gives them as SymPy equations without abbreviations.
    """

    title: str
    about: str
    sections: tuple[Section, ...]
    system: Symbolic

    def __repr__(self) -> str:
        lines = sum(len(section.lines) for section in self.sections)
        return f"<Derivation {self.title[:60]!r}: {lines} lines in {len(self.sections)} sections; print it>"

    def __str__(self) -> str:
        return self.text()

    def _repr_html_(self) -> str:
        parts = [f"<h3>{html.escape(self.title)}</h3>", f"<p>{html.escape(self.about)}</p>"]
        return "\n".join(["<div>", *parts, self.html_sections(4), "</div>"])

    def _repr_latex_(self) -> str:
        parts: list[str] = []
        for section in self.sections:
            parts.append(section.title)
            parts += [f"$${_latex(line)}$$" if line.sides else line.note for line in section.lines]
        return "\n\n".join(parts)

    def equations(self) -> tuple[sympy.Eq, ...]:
        """M a = h + B^T lambda for each coordinate (D.23, D.53), in SymPy; with the lambda of inequalities."""
        system, plain = self.system.all_closed, self.system.table.calculus.expanded
        equations = []
        for i in range(len(system.q)):
            left = sum((system.matrix(i, j) * a for j, a in enumerate(system.a)), sympy.Integer(0))
            right = system.h[i] + sum(
                (row.B[i] * lam for row, lam in zip(system.rows, system.lam, strict=True) if i in row.B),
                sympy.Integer(0),
            )
            equations.append(sympy.Eq(plain(left), plain(right), evaluate=False))
        return tuple(equations)

    def constraints(self) -> tuple[sympy.Eq, ...]:
        """f = 0 of holonomic rows (D.2), B v + b = 0 of differential ones (D.4), in SymPy."""
        system, plain = self.system, self.system.table.calculus.expanded
        constraints = []
        for row in system.rows:
            value = row.f
            if value is None:
                value = row.b + sum((slope * system.v[i] for i, slope in row.B.items()), sympy.Integer(0))
            constraints.append(sympy.Eq(plain(value), 0, evaluate=False))
        return tuple(constraints)

    def inequalities(self) -> tuple[sympy.Rel, ...]:
        """g >= 0, in SymPy."""
        rows, plain = self.system.contacts.rows, self.system.table.calculus.expanded
        return tuple(sympy.Ge(plain(row.f), 0, evaluate=False) for row in rows if row.f is not None)

    def text(self, width: int = WIDTH) -> str:
        """Unicode text in at most `width` columns where terms allow."""
        parts = [self.title, self.about]
        for section in self.sections:
            lefts = [render_text.text(line.sides[0]) if line.sides else "" for line in section.lines]
            widths = [render_text.width(left) for left in lefts]
            column = max((w for w in widths if w <= WIDEST_LEFT), default=0)
            found = []
            for line, own in zip(section.lines, widths, strict=True):
                if not line.sides:
                    found += ["  " + part for part in render_text.folded(line.note, width - 2)]
                    continue
                pad = " " * max(0, column - own)
                whole = f"  {pad}{line.joined(0, render_text.text)}"
                if line.note:
                    whole += f"   {line.note}"
                number = f"({line.number})" if line.number else ""
                indent = 2 + (column if own <= WIDEST_LEFT else 4) + 3
                rows = render_text.wrapped(whole, width - len(number) - 2, indent)
                rows[-1] += " " * max(2, width - render_text.width(rows[-1]) - len(number)) + number
                found += rows
            parts += ["", section.title, *found]
        return "\n".join(part.rstrip() for part in parts)

    def latex(self, fragment: bool = False) -> str:
        """A LaTeX document that needs amsmath only; as a fragment only its equations, one aligned environment for
        each section."""
        if fragment:
            return "\n".join(_fragment(self.title, self.sections))
        body = "\n".join([
            rf"\section*{{{render_latex.words(self.title)}}}",
            render_latex.words(self.about),
            self.latex_sections(),
        ])  # fmt: skip
        # A title may hold letters of any language, for which there is no sign in the fonts of LaTeX.
        declarations = latex_text.declarations(body)
        return "\n".join([
            r"\documentclass{article}",
            r"\usepackage[utf8]{inputenc}",
            r"\usepackage[T1]{fontenc}",
            r"\usepackage{amsmath}",
            r"\usepackage[margin=2cm]{geometry}",
            *([declarations] if declarations else []),
            r"\begin{document}",
            body,
            r"\end{document}",
        ])  # fmt: skip

    def latex_sections(self) -> str:
        """The sections alone in LaTeX."""
        return self._written(
            lambda title: [rf"\subsection*{{{render_latex.words(title)}}}"],
            lambda line: [r"\begin{equation*}", _latex(line), r"\end{equation*}"],
            lambda note: [render_latex.words(note) + r"\par"],
        )

    def _written(
        self,
        heading: Callable[[str], list[str]],
        equation: Callable[[Line], list[str]],
        note: Callable[[str], list[str]],
    ) -> str:
        """The rows of all sections: headings, and lines as equations and notes."""
        rows: list[str] = []
        for section in self.sections:
            rows += heading(section.title)
            for line in section.lines:
                rows += [*(equation(line) if line.sides else ()), *(note(line.note) if line.note else ())]
        return "\n".join(rows)

    def markdown(self) -> str:
        """Markdown with LaTeX between dollar signs."""
        parts = [f"# {_escaped(self.title)}", "", _escaped(self.about)]
        return "\n".join([*parts, self.markdown_sections(2)])

    def markdown_sections(self, level: int) -> str:
        """The sections alone in Markdown, under headings of this level."""
        return self._written(
            lambda title: ["", f"{'#' * level} {_escaped(title)}"],
            lambda line: ["", "$$", _latex(line), "$$"],
            lambda note: ["", _escaped(note)],
        )

    def html(self) -> str:
        """One HTML page with MathML: it needs no network."""
        parts = [
            "<!DOCTYPE html>",
            '<html lang="en"><head><meta charset="utf-8">',
            f"<title>{html.escape(self.title)}</title>",
            f"<style>{_STYLE}</style></head><body>",
            f"<h1>{html.escape(self.title)}</h1>",
            f'<p class="about">{html.escape(self.about)}</p>',
        ]
        return "\n".join([*parts, self.html_sections(2), "</body></html>"])

    def html_sections(self, level: int) -> str:
        """The sections alone in HTML with MathML, under headings of this level, as one part of a page."""
        parts: list[str] = []
        for section in self.sections:
            parts += [f"<h{level}>{html.escape(section.title)}</h{level}>", "<table>"]
            for line in section.lines:
                parts += _html(line)
            parts.append("</table>")
        return "\n".join(parts)

    def as_json(self) -> list[dict[str, str]]:
        """A list of {section, equation, left, right, latex, note}; a line in words has empty sides.

        The sign between the sides is `=`, or stands under `relation`: `0 ≤ λ ⊥ g ≥ 0` has the right `λ ⊥ g ≥ 0`.
        """
        return [
            {
                "section": section.title,
                "equation": line.number,
                "left": render_text.text(line.sides[0]) if line.sides else "",
                "right": line.joined(1, render_text.text),
                "latex": line.joined(0, render_latex.latex, render_latex.relation),
                "note": line.note,
                **({"relation": line.relations[0]} if line.signs and line.signs[0] != "=" else {}),
            }
            for section in self.sections
            for line in section.lines
        ]


def _chunks(node: f.FormulaNode) -> list[f.FormulaNode]:
    """A long sum in pieces of a line each."""
    if not isinstance(node, f.FormulaSum) or render_text.width(render_text.text(node)) <= LONG:
        return [node]
    chunks: list[list[tuple[int, f.FormulaNode]]] = [[]]
    used = 0
    for sign, term in node.terms:
        own = render_text.width(render_text.text(term)) + 3
        if chunks[-1] and used + own > LONG:
            chunks.append([])
            used = 0
        chunks[-1].append((sign, term))
        used += own
    return [f.FormulaSum(tuple(part)) for part in chunks]


def _latex(line: Line) -> str:
    tag = rf" \tag{{{line.number}}}" if line.number else ""
    if all(len(_chunks(side)) == 1 for side in line.sides):
        return line.joined(0, render_latex.latex, render_latex.relation) + tag
    # One mark of alignment in each row: before the sign of equality, or where a side goes on.
    rows: list[str] = []
    signs = ("", *map(render_latex.relation, line.relations))
    for index, (sign, side) in enumerate(zip(signs, line.sides, strict=True)):
        for part, chunk in enumerate(_chunks(side)):
            written = render_latex.latex(chunk)
            if part:
                rows.append(_goes_on(chunk))
            elif index == 0:
                rows.append(written if len(_chunks(side)) == 1 else f"& {written}")
            elif index == 1 and len(rows) == 1 and not rows[0].startswith("&"):
                rows[0] += f" &{sign} {written}"
            else:
                rows.append(f"&{sign} {written}")
    return "\\begin{split}\n" + " \\\\\n".join(rows) + "\n\\end{split}" + tag


def _fragment(title: str, sections: tuple[Section, ...]) -> Iterator[str]:
    """The equations alone: an `align*` for lines that follow each other, notes in words between them."""
    yield f"% {title}"
    yield r"% \usepackage{amsmath} is all that this needs; \allowdisplaybreaks lets it run over pages."
    for section in sections:
        yield f"% {section.title}"
        for is_note, lines in itertools.groupby(section.lines, key=lambda line: bool(line.sides)):
            if not is_note:
                yield from (f"{render_latex.words(line.note)}\n" for line in lines)
                continue
            equations = list(lines)
            # A left side beside which the others of its section would stand far to the right
            is_wide = any(
                render_text.width(render_text.text(line.sides[0])) > WIDEST_LEFT for line in equations
            )
            yield r"\begin{align*}"
            yield " \\\\\n".join(row for line in equations for row in _aligned(line, is_wide))
            yield r"\end{align*}"


def _aligned(line: Line, is_wide: bool) -> list[str]:
    """The rows of a line in `align*`, each with one mark of alignment, at its begin where left sides are wide; the
    last row has the note and the number."""
    left, *others = line.sides
    first, *more = _chunks(left)
    rows = [("& " if is_wide else "") + render_latex.latex(first)]
    rows += [_goes_on(chunk) for chunk in more]
    used = LONG if more else render_text.width(render_text.text(left))
    for relation, side in zip(map(render_latex.relation, line.relations), others, strict=True):
        first, *more = _chunks(side)
        own = render_text.width(render_text.text(first)) + 3
        written = f"{relation} {render_latex.latex(first)}"
        if "&" not in rows[-1]:
            rows[-1] += f" &{written}"
        elif used + own <= LONG:
            rows[-1] += f" {written}"
        else:
            rows.append(rf"&{_INDENT if is_wide else ''}{written}")
            used = 0
        used = LONG if more else used + own
        rows += [_goes_on(chunk) for chunk in more]
    if line.note:
        rows[-1] += rf" \quad \text{{{render_latex.words(line.note)}}}"
    if line.number:
        rows[-1] += rf" \tag{{{line.number}}}"
    return rows


def _goes_on(chunk: f.FormulaNode) -> str:
    """A row in which a long sum goes on."""
    return rf"&{_INDENT}{'' if _leads_negative(chunk) else '{} + '}{render_latex.latex(chunk)}"


def _html(line: Line) -> list[str]:
    note = html.escape(line.note)
    if not line.sides:
        return [f'<tr><td class="note" colspan="3">{note}</td></tr>']
    number = f"({line.number})" if line.number else ""
    tail = f'<td class="number">{html.escape(number)}</td></tr>'
    if note:
        note = f' <span class="note">{note}</span>'
    if render_text.width(render_text.text(line.sides[0])) > WIDEST_LEFT:
        rows = "<br>".join(_equated(line, 0))
        return [f'<tr><td class="whole" colspan="2">{rows}{note}</td>{tail}']
    left = _math(render_mathml.mathml(line.sides[0]))
    rows = "<br>".join(_equated(line, 1))
    return [f'<tr><td class="left">{left}</td><td>{rows}{note}</td>{tail}']


def _equated(line: Line, first: int) -> list[str]:
    """Sides with their signs before all but the very first, in rows of bearable length."""
    signs = ("=", *line.relations)
    rows: list[str] = []
    used = LONG
    for index, side in enumerate(line.sides[first:], first):
        for part, chunk in enumerate(_chunks(side)):
            sign = signs[index] if part == 0 else "" if _leads_negative(chunk) else "+"
            written = (f"<mo>{sign}</mo>" if sign and index else "") + render_mathml.mathml(chunk)
            own = render_text.width(render_text.text(chunk)) + 3
            if used + own > LONG or part:
                rows.append("")
                used = 0
            rows[-1] += written
            used += own
    return [_math(f"<mrow>{row}</mrow>") for row in rows]


def _leads_negative(node: f.FormulaNode) -> bool:
    return isinstance(node, f.FormulaSum) and node.terms[0][0] < 0


def _math(inner: str) -> str:
    return f'<math display="inline" displaystyle="true">{inner}</math>'


def _escaped(words: str) -> str:
    """Words that Markdown prints as they are."""
    return "".join(f"\\{letter}" if letter in "\\`*_{}[]<>#$|" else letter for letter in words)
