"""Codes of families: ranges, indices and members."""

from __future__ import annotations

from lagcli.errors.catalogue.page import Page

_CHAIN = """\
lagcli: 1
parameters: {N: 3}
particles:
  p[i]: {for: "i = 1..N", mass: 1, position: "[i, 0, 0]"}
"""

PAGES = (
    Page(
        code="bad-range",
        meaning="The name, the `for` or the `if` of a family is not written as a family needs it.",
        why='A family is a name with its indices and a range for each: `p[i]: {for: "i = 1..N", ...}`, or'
        " `p[i][j]` with a list of ranges. An index has a name of its own, and an `if` needs a `for`.",
        example=_CHAIN.replace("p[i]", "p"),
        cure="Write the index after the name.",
        old="  p:",
        new="  p[i]:",
    ),
    Page(
        code="not-a-whole-number",
        meaning="A bound or an index has a value that is not whole, is larger than 2**53, or is no integer expression.",
        why="Indices count. They are made of whole numbers, parameters with whole values and earlier indices, with"
        " `+ - * / **`, `min`, `max` and `abs`.",
        example=_CHAIN.replace("N: 3", "N: 2.5"),
        cure="Give the parameter a whole value, or write the bound so that it is whole.",
        old="N: 2.5",
        new="N: 3",
    ),
    Page(
        code="too-many-members",
        meaning="The families of the model have more members than the program takes, a force acts more often, or the"
        " expressions of all members have together too many parts.",
        why="A file of a few lines could otherwise ask for any amount of memory and time.",
        example=_CHAIN.replace("N: 3", "N: 10000000"),
        cure="Model fewer.",
        old="N: 10000000",
        new="N: 3",
    ),
    Page(
        code="no-such-member",
        meaning="A family has no member of this index, or its members have another number of indices.",
        why="An index that runs over the end of a family is most often a range that begins one too early; what the"
        " message calls the first is the value of the index at which it happens.",
        example=_CHAIN + 'holonomic:\n  rod[i]: {for: "i = 1..N", equation: "distance(p[i], p[i-1]) = 1"}\n',
        cure="Begin or end the range where all members exist.",
        old='rod[i]: {for: "i = 1..N"',
        new='rod[i]: {for: "i = 2..N"',
    ),
    Page(
        code="not-a-family",
        meaning="An index follows a name that is no family.",
        why="Only families have members; what is declared alone has its name alone.",
        example=_CHAIN
        + "  a: {mass: 1, position: [0, 0, 1]}\nholonomic:\n  rod: distance(a[1], p[1]) = sqrt(2)\n",
        cure="Leave the index out.",
        old="a[1]",
        new="a",
    ),
    Page(
        code="family-needs-index",
        meaning="The bare name of a family is used in an expression.",
        why="Alone it means all members, which has a meaning in a list (`to: p`), not in a formula.",
        example=_CHAIN + "holonomic:\n  floor: p.z = 0\n",
        cure="Name one member, or make the entry a family too.",
        old="floor: p.z = 0",
        new='floor[i]: {for: "i = 1..N", equation: "p[i].z = 0"}',
    ),
)
