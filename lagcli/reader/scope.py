"""Names: who declared them, and the facts about what they stand for.

Particles, coordinates, parameters, definitions and outputs share one namespace; functions have their own.
Facts are found when first asked for, so that a position may use a definition and a definition a position,
as long as they do not go in a circle.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Iterable
from typing import Any, Literal

from lagcli import diagnostics
from lagcli.expression import evaluate, facts, tokens, tree
from lagcli.expression.facts import Facts
from lagcli.expression.tree import ExpressionError

Kind = Literal["parameter", "coordinate", "particle", "definition", "output"]

RESERVED = ("t", "dt", "pi", "kinetic", "potential")
NOT_FOR_COLUMNS = ("all", "lambda", "R", "energy", "err")

VELOCITY = Facts(None, frozenset(("velocity",)), 1, 1)
RESULT = Facts(None, frozenset(("result",)))
OWN: dict[str, Any] = {
    "m": Facts(None, frozenset(("mass",))),
    "r": (Facts(None, frozenset(("position", "cartesian"))),) * 3,
    "v": (VELOCITY,) * 3,
}
_VELOCITY_MEMBERS = {"vx": 0, "vy": 1, "vz": 2}

BROKEN = ""  # the code of an error that follows from one already reported


@dataclasses.dataclass(slots=True)
class Entry:
    """A declared name. `find` computes its facts once, from those of the names it `uses`; a name that is not
    reached yet has none."""

    kind: Kind
    find: Callable[[], Any] | None = None
    uses: frozenset[str] = frozenset()
    value: Any = None
    searching: bool = False


def _article(kind: Kind) -> str:
    return f"an {kind}" if kind == "output" else f"a {kind}"


class Scope:
    """The namespace of one model."""

    def __init__(self) -> None:
        self._entries: dict[str, Entry] = {}
        self._hints: dict[str, str] = {}
        self._settled: list[str] = []
        # name -> its row names; none yet for a rigid body, None for a constraint that is broken
        self.constraints: dict[str, tuple[str, ...] | None] = {}

    def __contains__(self, name: str) -> bool:
        return name in self._entries

    def declare(self, name: str, kind: Kind) -> str:
        """Take a name; the returned sentence says why it cannot be taken, or is empty."""
        if not tokens.is_name(name):
            return "a name is a letter or `_`, then letters, digits and `_`"
        if name in RESERVED:
            return f"`{name}` is reserved"
        if kind in ("particle", "coordinate", "output") and name in NOT_FOR_COLUMNS:
            return f"{_article(kind)} may not be called `{name}`: columns of the table use that word"
        if name in self._entries:
            return f"`{name}` is already the name of {_article(self._entries[name].kind)}"
        self._entries[name] = Entry(kind)
        return ""

    def spoil(self, name: str, kind: Kind) -> None:
        """Take a name whose declaration has been refused, so that its uses are not refused too."""
        self._entries.setdefault(name, Entry(kind, value=BROKEN))

    def define(self, name: str, find: Callable[[], Any], uses: Iterable[str] = ()) -> None:
        """Say how the facts of a declared name are found; from here on it may be used."""
        entry = self._entries.get(name)
        if entry is not None and entry.find is None:
            entry.find, entry.uses = find, frozenset(uses)

    def kind(self, name: str) -> Kind | None:
        """What the name was declared as."""
        entry = self._entries.get(name)
        return entry.kind if entry else None

    def names(self, *kinds: Kind) -> list[str]:
        """All declared names of these kinds, in order."""
        return [name for name, entry in self._entries.items() if entry.kind in kinds]

    def order(self, *kinds: Kind) -> tuple[str, ...]:
        """The names of these kinds, each after all that it uses."""
        return tuple(name for name in self._settled if self._entries[name].kind in kinds)

    def constant(self, name: str) -> Any:
        """Value of a parameter: a float, a tuple of three, or None while it is broken."""
        found = self._entries[name].value
        if isinstance(found, tuple):
            return tuple(part.value for part in found)
        return found.value if isinstance(found, Facts) else None

    def lookup(self, node: tree.Node, own: bool = False) -> Any:
        """The facts a leaf or special call stands for; `own` opens `m`, `r`, `v` of a particle."""
        match node:
            case tree.Name():
                return self._name(node, node.name, own)
            case tree.Member():
                return self._member(node, own)
            case tree.Call():
                return self._special(node)
            case tree.Index():
                message = "families `name[i]` are not supported yet"
                raise ExpressionError("not-supported-yet", message, node.start, node.end)
            case _:
                raise TypeError(node)

    def _name(self, node: tree.Node, name: str, own: bool) -> Any:
        if own and name in OWN:
            return OWN[name]
        if name == "t":
            return Facts(None, frozenset(("time",)))
        if name == "pi":
            return Facts(3.141592653589793)
        if name == "dt":
            return Facts(None, frozenset(("differential",)), 1, 1)
        if name in ("kinetic", "potential"):
            return RESULT
        return self._declared(node, name)

    def _declared(self, node: tree.Node, name: str) -> Any:
        entry = self._entries.get(name)
        if entry is None:
            raise self._unknown(node, name, [*self._entries, *RESERVED])
        if entry.find is None and entry.value is None:
            message = f"the {entry.kind} `{name}` is used before it is declared"
            raise ExpressionError("used-before-declared", message, node.start, node.end)
        if entry.value is None:
            if entry.searching:
                message = f"`{name}` depends on itself"
                raise ExpressionError("circular", message, node.start, node.end)
            self._settle(name)
        if entry.value is BROKEN:
            raise ExpressionError(BROKEN, "", node.start, node.end)
        return entry.value

    def _settle(self, name: str) -> None:
        """Find the facts of a name, those of all it uses before: a long chain needs no deep stack."""
        waiting = [name]
        while waiting:
            name = waiting[-1]
            entry = self._entries[name]
            if entry.value is None and not entry.searching:
                entry.searching = True
                waiting += sorted(used for used in entry.uses if self._is_open(used))
                continue
            waiting.pop()
            if entry.value is None and entry.find is not None:
                found = entry.find()
                entry.value = BROKEN if found is None else found
                entry.searching = False
                self._settled.append(name)

    def _is_open(self, name: str) -> bool:
        entry = self._entries.get(name)
        return entry is not None and entry.find is not None and entry.value is None and not entry.searching

    def _unknown(self, node: tree.Node, name: str, known: Iterable[str]) -> ExpressionError:
        if name in evaluate.FUNCTION_NAMES:
            hint = f"`{name}` is a function: write `{name}(...)`"
        elif name == "g":
            hint = "declare it under `parameters`, for example `g: 9.81`"
        else:
            if name not in self._hints:
                self._hints[name] = diagnostics.nearest(name, known)
            hint = self._hints[name]
        return ExpressionError("unknown-name", f"the name `{name}` is not known", node.start, node.end, hint)

    def _member(self, node: tree.Member, own: bool) -> Any:
        spot = tree.Name(node.start, node.start + len(node.owner), node.owner)
        owner = self._name(spot, node.owner, own)
        if self.kind(node.owner) == "particle" and not (own and node.owner in OWN):
            if node.member == "v":
                return (VELOCITY,) * 3
            if node.member in _VELOCITY_MEMBERS:
                return VELOCITY
            if node.member not in evaluate.COMPONENTS:
                hint = "a particle has `.x` `.y` `.z`, `.vx` `.vy` `.vz` and the vector `.v`"
                message = f"a particle has no `.{node.member}`"
                raise ExpressionError("unknown-component", message, node.start, node.end, hint)
        return evaluate.component(node, owner, node.member, node.owner)

    def _special(self, node: tree.Call) -> Any:
        argument = node.arguments[0]
        if node.function == "rate":
            return self._rate(node, argument)
        if node.function == "reaction":
            if isinstance(argument, tree.Name) and self.kind(argument.name) == "particle":
                return (RESULT,) * 3
            self._known_argument(argument, self.names("particle"), "particle", "reaction(...)")
        return self._multiplier(argument)

    def _rate(self, node: tree.Call, argument: tree.Node) -> Any:
        if isinstance(argument, tree.Name) and self.kind(argument.name) == "coordinate":
            self._declared(argument, argument.name)
            return VELOCITY
        if isinstance(argument, tree.Name) and self.kind(argument.name) == "particle":
            return (VELOCITY,) * 3
        if isinstance(argument, tree.Member) and self.kind(argument.owner) == "particle":
            if argument.member in evaluate.COMPONENTS:
                return VELOCITY
            raise ExpressionError("bad-rate", "rates of velocities are accelerations", node.start, node.end)
        if isinstance(argument, (tree.Name, tree.Index)):
            self._known_argument(argument, self.names("coordinate"), "coordinate", "rate(...)")
        hint = "in a differential constraint, `d(...)` takes any expression"
        message = "`rate(...)` takes the name of a generalized coordinate"
        raise ExpressionError("bad-rate", message, argument.start, argument.end, hint)

    def _known_argument(self, node: tree.Node, known: list[str], kind: str, call: str) -> None:
        if isinstance(node, tree.Index):
            self.lookup(node)
        if isinstance(node, tree.Name) and node.name not in self._entries:
            raise self._unknown(node, node.name, known)
        message = f"`{call}` takes the name of a {kind}"
        raise ExpressionError("wrong-arguments", message, node.start, node.end)

    def _multiplier(self, argument: tree.Node) -> Any:
        name = getattr(argument, "owner", getattr(argument, "name", ""))
        if name in self.constraints and self.constraints[name] is None:
            raise ExpressionError(BROKEN, "", argument.start, argument.end)
        if isinstance(argument, tree.Name) and argument.name in self.constraints:
            rows = self.constraints[argument.name] or ()
            if rows == (argument.name,):
                return RESULT
            if rows and rows[0] == f"{argument.name}.x":
                return (RESULT,) * 3
            message = f"the body `{argument.name}` has several multipliers"
            hint = f"write `multiplier({argument.name}.1)`, `multiplier({argument.name}.2)`, ..."
            raise ExpressionError("wrong-arguments", message, argument.start, argument.end, hint)
        if isinstance(argument, tree.Member) and argument.owner in self.constraints:
            rows = self.constraints[argument.owner] or ()
            # The rows of a rigid body are known by number only once its geometry is; they are checked there.
            if f"{argument.owner}.{argument.member}" in rows or (not rows and argument.member.isdigit()):
                return RESULT
        hint = diagnostics.nearest(name, self.constraints)
        message = "`multiplier(...)` takes the name of a constraint"
        raise ExpressionError("unknown-constraint", message, argument.start, argument.end, hint)


def lookup_with_own(scope: Scope) -> Callable[[tree.Node], Any]:
    """The lookup inside the force of a particle."""
    return lambda node: scope.lookup(node, own=True)


def reads(value: Any) -> frozenset[facts.Flag]:
    """All that a scalar or vector reads."""
    parts = value if isinstance(value, tuple) else (value,)
    return frozenset[facts.Flag]().union(*(part.reads for part in parts))
