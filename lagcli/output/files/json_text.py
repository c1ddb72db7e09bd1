"""JSON for standard output."""

from __future__ import annotations


def text(value: object) -> str:
    """One line of JSON. Letters stay as they are; what a terminal would act on is escaped."""
    # Most commands print none.
    import json

    line = json.dumps(value, ensure_ascii=False, allow_nan=False)
    # Characters that are not printable stand inside of strings only, where an escape means the same.
    return "".join(c if c.isprintable() else json.dumps(c)[1:-1] for c in line)
