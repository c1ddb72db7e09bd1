"""Tree of nodes -> `model.Model`, with every error of the file found in one go.

`keys` declares the keys of the format once. `document` reads the sections in order, each with the part that
knows it: `scope` for names, `formula` for expressions, `sections` for the entries.
"""
