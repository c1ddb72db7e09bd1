"""Lines that are left out of a page: of families all but a few, of long sums the terms between the first and last."""

from __future__ import annotations

import dataclasses
from collections.abc import Iterator

from lagcli.derivation.sections.derivation_page import Line
from lagcli.derivation.writing import formula as f

# Of a family this many lines are shown, then the last one; of a long sum this many terms.
SHOWN, TERMS = 2, 16


def cut(lines: list[Line]) -> Iterator[Line]:
    """The lines, of each family the first and the last ones, with what was left out."""
    groups: dict[tuple[str, str], list[int]] = {}
    for place, line in enumerate(lines):
        if line.family:
            groups.setdefault((line.kind, line.family), []).append(place)
    left_out: dict[int, str] = {}
    dropped = set[int]()
    for places in groups.values():
        if len(places) > SHOWN + 3:
            gone = places[SHOWN:-1]
            left_out[gone[0]] = f"… {len(gone)} lines like these left out; --all shows them"
            dropped.update(gone)
    for place, line in enumerate(lines):
        if place in left_out:
            yield Line(note=left_out[place])
        if place not in dropped:
            yield dataclasses.replace(line, sides=tuple(map(_shortened, line.sides)))


def _shortened(node: f.FormulaNode) -> f.FormulaNode:
    """A long sum with its first terms and its last one."""
    if isinstance(node, f.FormulaProduct):
        return f.FormulaProduct(tuple(map(_shortened, node.factors)))
    if not isinstance(node, f.FormulaSum) or len(node.terms) <= TERMS:
        return node
    gone = len(node.terms) - 4
    return f.FormulaSum((*node.terms[:3], (1, f.FormulaWords(f"… ({gone} terms left out)")), node.terms[-1]))
