"""Models from files and texts, and their compiled systems.

In: a path, text or `model.Model`
Out: `model.Model`, `cache.CompiledModel`
"""
