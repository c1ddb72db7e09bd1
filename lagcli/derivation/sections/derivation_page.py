"""A derivation as a page: sections of numbered lines, in every format."""

from __future__ import annotations

import dataclasses
import html
import itertools
import re
from collections.abc import Callable, Iterator

import sympy

from lagcli.derivation.symbolic.symbolic_system import Symbolic
from lagcli.derivation.writing import formula as f
from lagcli.derivation.writing import markup, render_text
from lagcli.output import latex_text

WIDTH = 100  # columns where there is no terminal
WIDEST_LEFT = 22  # columns: wider sides do not push the others of their section to the right
LONG = 90  # columns of a formula after which LaTeX and MathML begin a new line

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
        self, written: Callable[[f.FormulaNode], str], first: int = 0, relation: Callable[[str], str] = str
    ) -> str:
        """The sides from a number on with the signs between them."""
        before = ("", *(f" {relation(sign)} " for sign in self.relations[first:]))
        return "".join(sign + written(side) for sign, side in zip(before, self.sides[first:], strict=False))

    def pieces(self, first: int = 0) -> Iterator[tuple[str, f.FormulaNode, int, bool]]:
        """The sides from a number on in pieces of a row each: the sign before a piece, the piece, its columns, and
        whether a long sum goes on with it."""
        for relation, side in zip(("", *self.relations)[first:], self.sides[first:], strict=True):
            pieces, used = [side], 0
            if isinstance(side, f.FormulaSum) and render_text.columns(side) > LONG:
                terms: list[list[tuple[int, f.FormulaNode]]] = [[]]
                for term in side.terms:
                    own = render_text.columns(term[1]) + 3
                    if terms[-1] and used + own > LONG:
                        terms.append([])
                        used = 0
                    terms[-1].append(term)
                    used += own
                pieces = [f.FormulaSum(tuple(part)) for part in terms]
            for number, piece in enumerate(pieces):
                leads_negative = isinstance(piece, f.FormulaSum) and piece.terms[0][0] < 0
                sign = relation if number == 0 else "" if leads_negative else "+"
                yield sign, piece, render_text.columns(piece) + 3, number > 0

    @property
    def is_wide(self) -> bool:
        """True where the other sides would stand far to the right beside the left one."""
        return render_text.columns(self.sides[0]) > WIDEST_LEFT

    def latex(self) -> str:
        """The line as one equation, split where it is long."""
        tag = rf" \tag{{{self.number}}}" if self.number else ""
        goes_on = [later for *_, later in self.pieces()]
        if not any(goes_on):
            return self.joined(markup.latex, relation=markup.RELATIONS.__getitem__) + tag
        rows = self.latex_rows(at_begin=goes_on[1])
        return "\\begin{split}\n" + " \\\\\n".join(rows) + "\n\\end{split}" + tag

    def latex_rows(self, at_begin: bool, indent: str = "", room: int = 0) -> list[str]:
        """Rows with one mark of alignment each: before the second side, or where a side goes on; before the first one
        `at_begin`. Sides stand in one row as far as there is room."""
        rows: list[str] = []
        for sign, piece, own, goes_on in self.pieces():
            written = markup.latex(piece)
            relation = "" if goes_on else markup.RELATIONS.get(sign, "")
            if not rows:
                rows.append(("& " if at_begin else "") + written)
                used = own - 3
            elif goes_on:
                rows.append(rf"&\quad {'{} + ' if sign else ''}{written}")
                used = LONG
            elif "&" not in rows[-1]:
                rows[-1] += f" &{relation} {written}"
                used += own
            elif used + own <= room:
                rows[-1] += f" {relation} {written}"
                used += own
            else:
                rows.append(f"&{indent}{relation} {written}")
                used = own
        return rows

    def html(self) -> str:
        """The line as a row of a table, its sides in rows of bearable length."""
        note = html.escape(self.note)
        if not self.sides:
            return f'<tr><td class="note" colspan="3">{note}</td></tr>'
        if note:
            note = f' <span class="note">{note}</span>'
        rows: list[str] = []
        used = LONG
        for sign, piece, own, goes_on in self.pieces(0 if self.is_wide else 1):
            if used + own > LONG or goes_on:
                rows.append("")
                used = 0
            rows[-1] += (f"<mo>{sign}</mo>" if sign else "") + markup.mathml(piece)
            used += own
        sides = "<br>".join(_math(f"<mrow>{row}</mrow>") for row in rows) + note
        if self.is_wide:
            cells = f'<td class="whole" colspan="2">{sides}</td>'
        else:
            cells = f'<td class="left">{_math(markup.mathml(self.sides[0]))}</td><td>{sides}</td>'
        number = html.escape(f"({self.number})") if self.number else ""
        return f'<tr>{cells}<td class="number">{number}</td></tr>'


def _math(inner: str) -> str:
    return f'<math display="inline" displaystyle="true">{inner}</math>'


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
            parts += [f"$${line.latex()}$$" if line.sides else line.note for line in section.lines]
        return "\n\n".join(parts)

    def equations(self) -> tuple[sympy.Eq, ...]:
        """M a = h + B^T lambda for each coordinate (D.23, D.53), in SymPy; with the lambda of inequalities."""
        system, plain = self.system.all_closed, self.system.table.calculus.expanded
        equations = []
        for i in range(len(system.q)):
            left, right = system.inertial(i, system.a), system.h[i] + system.pull(i, system.lam)
            equations.append(sympy.Eq(plain(left), plain(right), evaluate=False))
        return tuple(equations)

    def constraints(self) -> tuple[sympy.Eq, ...]:
        """f = 0 of holonomic rows (D.2), B v + b = 0 of differential ones (D.4), in SymPy."""
        system, plain = self.system, self.system.table.calculus.expanded
        constraints = []
        for row in system.rows:
            value = system.velocity(row) if row.f is None else row.f
            constraints.append(sympy.Eq(plain(value), 0, evaluate=False))
        return tuple(constraints)

    def inequalities(self) -> tuple[sympy.Rel, ...]:
        """g >= 0, in SymPy."""
        plain = self.system.table.calculus.expanded
        return tuple(sympy.Ge(plain(row.f), 0, evaluate=False) for row in self.system.contacts.rows)

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
                whole = f"  {pad}{line.joined(render_text.text)}"
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
            return self._latex_fragment()
        title, about = map(markup.latex_words, (self.title, self.about))
        body = "\n".join([rf"\section*{{{title}}}", about, self.latex_sections()])
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

    def _latex_fragment(self) -> str:
        """The equations alone: an `align*` for lines that follow each other, notes in words between them."""
        parts = [
            f"% {self.title}",
            r"% \usepackage{amsmath} is all that this needs; \allowdisplaybreaks lets it run over pages.",
        ]
        for section in self.sections:
            parts.append(f"% {section.title}")
            for has_sides, group in itertools.groupby(section.lines, key=lambda line: bool(line.sides)):
                lines = list(group)
                if not has_sides:
                    parts += [f"{markup.latex_words(line.note)}\n" for line in lines]
                    continue
                is_wide = any(line.is_wide for line in lines)
                aligned: list[str] = []
                for line in lines:
                    aligned += line.latex_rows(is_wide, r"\quad " if is_wide else "", LONG)
                    if line.note:
                        aligned[-1] += rf" \quad \text{{{markup.latex_words(line.note)}}}"
                    if line.number:
                        aligned[-1] += rf" \tag{{{line.number}}}"
                parts += [r"\begin{align*}", " \\\\\n".join(aligned), r"\end{align*}"]
        return "\n".join(parts)

    def latex_sections(self) -> str:
        """The sections alone in LaTeX."""
        equation = "\\begin{equation*}\n%s\n\\end{equation*}"
        return self._written(markup.latex_words, r"\subsection*{%s}", equation, r"%s\par")

    def _written(self, words: Callable[[str], str], heading: str, equation: str, note: str) -> str:
        """All sections: their titles, lines as equations in LaTeX and their notes put into what stands around them."""
        rows: list[str] = []
        for section in self.sections:
            rows.append(heading % words(section.title))
            for line in section.lines:
                rows += [equation % line.latex()] if line.sides else []
                rows += [note % words(line.note)] if line.note else []
        return "\n".join(rows)

    def markdown(self) -> str:
        """Markdown with LaTeX between dollar signs."""
        return "\n".join([f"# {_escaped(self.title)}", "", _escaped(self.about), self.markdown_sections(2)])

    def markdown_sections(self, level: int) -> str:
        """The sections alone in Markdown, under headings of this level."""
        return self._written(_escaped, f"\n{'#' * level} %s", "\n$$\n%s\n$$", "\n%s")

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
            parts += [*(line.html() for line in section.lines), "</table>"]
        return "\n".join(parts)

    def as_json(self) -> list[dict[str, str]]:
        """A list of {section, equation, left, right, latex, note}; a line in words has empty sides. The sign between
        the sides is `=`, or stands under `relation`: `0 ≤ λ ⊥ g ≥ 0` has the right `λ ⊥ g ≥ 0`."""
        return [
            {
                "section": section.title,
                "equation": line.number,
                "left": render_text.text(line.sides[0]) if line.sides else "",
                "right": line.joined(render_text.text, 1),
                "latex": line.joined(markup.latex, relation=markup.RELATIONS.__getitem__),
                "note": line.note,
                **({"relation": line.relations[0]} if line.signs and line.signs[0] != "=" else {}),
            }
            for section in self.sections
            for line in section.lines
        ]


def _escaped(words: str) -> str:
    """Words that Markdown prints as they are."""
    return re.sub(r"([\\`*_{}\[\]<>#$|])", r"\\\1", words)
