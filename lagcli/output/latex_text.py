"""Plain texts as LaTeX prints them, and what its encoding of characters has to be told."""

from __future__ import annotations

import re
import unicodedata

# Characters that LaTeX takes for commands, and those that it prints as others outside of mathematics.
RESERVED = {
    "\\": r"\textbackslash{}",
    "{": r"\{",
    "}": r"\}",
    "_": r"\_",
    "^": r"\textasciicircum{}",
    "~": r"\textasciitilde{}",
    "#": r"\#",
    "$": r"\$",
    "%": r"\%",
    "&": r"\&",
}
SPECIAL = {
    **RESERVED,
    "<": r"\textless{}",
    ">": r"\textgreater{}",
    "|": r"\textbar{}",
    '"': r"\textquotedbl{}",
    "'": r"\textquotesingle{}",
    "`": r"\textasciigrave{}",
    "-": r"{-}",  # two of them are no dash
}
LONG, PIECE = 24, 12  # letters of a word that may be broken, and of its pieces
# Characters beside Greek letters and raised and lowered ones that reports are written with.
_MATH = {
    "−": "-", "≤": r"\le", "≥": r"\ge", "≠": r"\ne", "≈": r"\approx", "√": r"\surd", "∂": r"\partial", "∇": r"\nabla",
    "∑": r"\sum", "∫": r"\int", "∞": r"\infty", "⊥": r"\perp", "→": r"\to", "←": r"\leftarrow", "↔": r"\leftrightarrow",
    "∈": r"\in", "′": "'", "⋅": r"\cdot", "∧": r"\wedge", "‖": r"\|", "\u0307": r"\dot{}", "\u0308": r"\ddot{}",
}  # fmt: skip
_GREEK = re.compile(r"GREEK (SMALL|CAPITAL) LETTER (\w+)")
# Capitals that are those of the Latin alphabet, and small letters of other names, in LaTeX.
_LATIN = {
    "ALPHA": "A", "BETA": "B", "EPSILON": "E", "ZETA": "Z", "ETA": "H", "IOTA": "I", "KAPPA": "K", "MU": "M", "NU": "N",
    "OMICRON": "O", "RHO": "P", "TAU": "T", "CHI": "X",
}  # fmt: skip
_NAMED = {"OMICRON": "o", "LAMDA": r"\lambda", "FINAL": r"\varsigma"}
LAST_LATIN = "\u017f"  # to which the encoding T1 knows letters by itself
_KNOWN = "–—‘’“”…€†‡•™"


def plain(text: str) -> str:
    """A text that is printed as it is; long words may be broken."""
    pieces = []
    for number, word in enumerate(re.split(r"(\s+)", text)):
        letters = [SPECIAL.get(letter, letter) for letter in word]
        step = PIECE if len(word) > LONG else len(word) or 1
        parts = ["".join(letters[k : k + step]) for k in range(0, len(letters), step)]
        pieces.append(" " if number % 2 else r"\allowbreak{}".join(parts))
    return "".join(pieces)


def listed(line: str) -> str:
    """A line of a file, with the spaces it begins with."""
    body = line.lstrip(" ")
    return rf"\hspace*{{{len(line) - len(body)}ex}}{plain(body)}"


def declarations(document: str) -> str:
    """The lines that say how characters are printed that LaTeX does not know: by their numbers, where there is no
    sign."""
    unknown = sorted({letter for letter in document if letter > LAST_LATIN and letter not in _KNOWN})
    return "\n".join(rf"\DeclareUnicodeCharacter{{{ord(one):04X}}}{{{_sign(one)}}}" for one in unknown)


def _sign(letter: str) -> str:
    if letter in _MATH:
        return rf"\ensuremath{{{_MATH[letter]}}}"
    if found := _GREEK.fullmatch(unicodedata.name(letter, "")):
        name = found[2]
        if found[1] == "CAPITAL" and name in _LATIN:
            return rf"\ensuremath{{\mathrm{{{_LATIN[name]}}}}}"
        if found[1] == "SMALL" and name in _NAMED:
            return rf"\ensuremath{{{_NAMED[name]}}}"
        command = name.capitalize() if found[1] == "CAPITAL" else name.lower()
        return rf"\ensuremath{{\{command.replace('Lamda', 'Lambda')}}}"
    kind, _, plain_letter = unicodedata.decomposition(letter).partition(" ")
    if kind in ("<super>", "<sub>") and len(plain_letter) == 4:
        moved = chr(int(plain_letter, 16))
        if moved in "\u2212+" or (moved.isascii() and moved.isalnum()):
            written = moved.replace("\u2212", "-")
            return rf"\ensuremath{{{'^' if kind == '<super>' else '_'}{{{written}}}}}"
    return rf"\texttt{{[U+{ord(letter):04X}]}}"
