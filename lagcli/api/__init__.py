"""The commands as Python functions: each calls the stages in their order.

In: `model.Model` or a path, options
Out: the result of a command

No physics and no printing here.
"""
