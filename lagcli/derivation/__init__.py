"""The equations of motion of a model, as a person would write them: symbols all the way, and the text's numbers.

    M a = h + B^T lambda,  B v + b = 0  (D.23, D.24, D.53)

`system` derives them from the model's own expressions, `sections` puts them in lines, `layout` decides how a line
looks, and the renderers write it as text, LaTeX or MathML.
"""

from __future__ import annotations

from lagcli.derivation.derive import Options, derive
from lagcli.derivation.page import Derivation

__all__ = ["Derivation", "Options", "derive"]
