"""What each diagnostic code means, why it is given, an example and the cure: the pages of `lagcli explain`.

One file for each family of codes; the sentence that names the spot in a user's file stands where it is found.
"""

from __future__ import annotations

import textwrap

from lagcli.errors.catalogue import (
    entry_errors,
    expression_errors,
    family_errors,
    file_errors,
    name_errors,
    start_errors,
    stop_errors,
)
from lagcli.errors.catalogue.page import Page

_PAGES: dict[str, Page] = {
    page.code: page
    for page in sorted(
        (
            *file_errors.PAGES,
            *entry_errors.PAGES,
            *family_errors.PAGES,
            *name_errors.PAGES,
            *expression_errors.PAGES,
            *start_errors.PAGES,
            *stop_errors.PAGES,
        ),
        key=lambda page: page.code,
    )
}

WIDTH = 100


def page(code: str) -> Page | None:
    """The page of a code, or None where there is no such code."""
    return _PAGES.get(code)


def codes() -> tuple[str, ...]:
    """All codes, in the order of the alphabet."""
    return tuple(_PAGES)


def lines() -> list[str]:
    """All codes, each with its meaning on the same line."""
    width = max(map(len, _PAGES))
    return [f"{code:{width}}  {page.meaning}" for code, page in _PAGES.items()]


def render(page: Page) -> str:
    """A page as plain text."""
    parts = [
        f"{page.severity}[{page.code}]",
        textwrap.fill(page.meaning, WIDTH),
        "Why:\n" + textwrap.fill(page.why, WIDTH, initial_indent="  ", subsequent_indent="  "),
        "Example:\n" + textwrap.indent(page.example.rstrip() or "(an empty file)", "    "),
        "Fix:\n" + textwrap.fill(page.cure, WIDTH, initial_indent="  ", subsequent_indent="  "),
    ]
    if page.mended_lines:
        parts.append(textwrap.indent("\n".join(page.mended_lines), "    "))
    return "\n\n".join(parts)
