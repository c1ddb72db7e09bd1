"""Names of a model as signs on paper: `theta1` is a theta with a subscript, `a.x` an x of the particle a.

Two things never look alike: where the readable sign is taken, the name of the model itself is printed.
"""

from __future__ import annotations

import re

from lagcli.derivation.writing.formula import Sign

GREEK = {
    "alpha": "α",
    "beta": "β",
    "gamma": "γ",
    "delta": "δ",
    "epsilon": "ε",
    "zeta": "ζ",
    "eta": "η",
    "theta": "θ",
    "iota": "ι",
    "kappa": "κ",
    "mu": "μ",
    "nu": "ν",
    "xi": "ξ",
    "rho": "ρ",
    "sigma": "σ",
    "tau": "τ",
    "phi": "φ",
    "chi": "χ",
    "psi": "ψ",
    "omega": "ω",
    "Gamma": "Γ",
    "Delta": "Δ",
    "Theta": "Θ",
    "Lambda": "Λ",
    "Xi": "Ξ",
    "Pi": "Π",
    "Sigma": "Σ",
    "Phi": "Φ",
    "Psi": "Ψ",
    "Omega": "Ω",
}
LETTERS = {letter: name for name, letter in GREEK.items()} | {
    "λ": "lambda",
    "π": "pi",
    "ℓ": "ell",
    "∂": "partial",
}

_LETTER = re.compile(rf"({'|'.join(GREEK)}|[A-Za-z])(\d*)(?:_(.+))?")
_INDEX = re.compile(r"\[(-?\d+)\]")


def subscript(name: str) -> str:
    """A name as a subscript: `p[3][1]` is `p3,1`, Greek names become letters."""
    base, *indices = name.replace("]", "").split("[")
    plain = GREEK.get(base, base)
    return plain + ",".join(indices)


def family(name: str) -> str:
    """The name of a family of a member with indices; empty where there is none."""
    base = name.partition("[")[0]
    return base if base != name else ""


def sign(name: str, vector: bool = False) -> Sign:
    """The sign of a parameter or coordinate."""
    base, indices = name.partition("[")[0], tuple(_INDEX.findall(name))
    match = _LETTER.fullmatch(base)
    if match is None:
        return Sign(base, indices, vector=vector)
    letter, digits, rest = match.groups()
    sub = tuple(part for part in (digits, rest) if part) + indices
    return Sign(GREEK.get(letter, letter), sub, vector=vector)


def component(name: str, axis: str) -> Sign:
    """x, y or z of a particle."""
    return Sign(axis, (subscript(name),))


class Register:
    """The signs in use."""

    def __init__(self) -> None:
        self._taken: set[tuple[str, bool]] = set()

    def take(self, wanted: Sign, name: str) -> Sign:
        """The sign, or the name itself where that sign, or one that reads alike, stands for something else."""
        return self.take_first((wanted, Sign(name, vector=wanted.vector)), name)

    def take_first(self, wanted: tuple[Sign, ...], name: str) -> Sign:
        """The first of these signs that is free, else the name with a prime."""
        for candidate in wanted:
            key = (candidate.base + "_" + ",".join(candidate.sub)).rstrip("_"), candidate.vector
            if key not in self._taken:
                self._taken.add(key)
                return candidate
        return self.take(Sign(name + "'", vector=wanted[0].vector), name + "'")
