"""The equations of motion of a model, as a person would write them, with the text's equation numbers.

In: `model.Model`
Out: `derivation_page.Derivation` in five formats

    M a = h + B^T lambda,  B v + b = 0  (D.23, D.24, D.53)

`symbolic` derives them from the model's own expressions, `sections` puts them in lines, and `writing` decides how a
line looks and writes it as text, LaTeX and MathML.
"""

from __future__ import annotations

from lagcli.derivation.derivation import Options, derive
from lagcli.derivation.sections.derivation_page import Derivation
from lagcli.derivation.sections.linear_section import LinearPoint

__all__ = ["Derivation", "LinearPoint", "Options", "derive"]
