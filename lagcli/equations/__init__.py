"""A model to the unified system of (D.6), (D.7), (D.24), in CasADi symbols.

In: `model.Model`
Out: `system.System`: M, h, B, b, gamma, f

    M a = h + B^T lambda,    B v + b = 0,    B a = gamma,    f = 0 where a row is holonomic

`symbols` makes symbols and evaluates expressions over them, `environment` gives names their values, `rows` builds the
constraint rows, `rigid` the geometry of rigid bodies, `energy` T, V, L and the forces, `system` puts them together.
The sign of lambda is decided in `system` and nowhere else: R = + B^T lambda.
"""
