"""Points of rest and stationary points of a compiled model, and the linear equations about one.

In: `compiled_model.CompiledModel`, a question
Out: `static_report.StaticReport`, a reference for `linearization`
"""
