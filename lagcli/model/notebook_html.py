"""Short pages for notebooks: sentences and tables as HTML, every text escaped."""

from __future__ import annotations

import html
from collections.abc import Iterable, Sequence

from lagcli.errors import diagnostics

MOST_ROWS = 40  # of a table: a screen
MOST_LETTERS = 200  # of a cell


def page(title: str, *parts: str) -> str:
    """The parts under a title."""
    return "\n".join(["<div>", f"<p><strong>{_text(title)}</strong></p>", *filter(None, parts), "</div>"])


def sentences(texts: Iterable[str]) -> str:
    """A paragraph for each text, of which many are counted."""
    items = list(texts)
    shown = items[:MOST_ROWS]
    more = [f"and {len(items) - len(shown)} others"] if len(items) > len(shown) else []
    return "\n".join(f"<p>{_text(text)}</p>" for text in [*shown, *more])


def table(headers: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    """A table; columns that are empty throughout are left out, and rows beyond a screen are counted."""
    if not rows:
        return ""
    filled = [k for k in range(len(headers)) if any(row[k] for row in rows)]
    lines = ["<table>", "<thead>", _row("th", [headers[k] for k in filled]), "</thead>", "<tbody>"]
    lines += [_row("td", [row[k] for k in filled]) for row in rows[:MOST_ROWS]]
    lines += ["</tbody>", "</table>"]
    if len(rows) > MOST_ROWS:
        lines.append(f"<p>and {len(rows) - MOST_ROWS} others</p>")
    return "\n".join(lines)


def _row(tag: str, cells: Sequence[str]) -> str:
    return (
        "<tr>" + "".join(f'<{tag} style="text-align: left">{_text(cell)}</{tag}>' for cell in cells) + "</tr>"
    )


def _text(text: str) -> str:
    plain = diagnostics.printable(text)
    return html.escape(plain if len(plain) <= MOST_LETTERS else f"{plain[: MOST_LETTERS - 1]}…")
