"""The equations of motion of a model, as a person would write them, with the text's equation numbers.

In: `model.Model`
Out: `derivation_page.Derivation` in five formats

    M a = h + B^T lambda,  B v + b = 0  (D.23, D.24, D.53)

`symbolic_system` derives them from the model's own expressions, `page_sections` puts them in lines, `layout` decides
how a line looks, and `render_text`, `render_latex` and `render_mathml` write it.
"""

from __future__ import annotations

from lagcli.derivation.derivation import Options, derive
from lagcli.derivation.derivation_page import Derivation
from lagcli.derivation.linear_matrices import LinearPoint

__all__ = ["Derivation", "LinearPoint", "Options", "derive"]
