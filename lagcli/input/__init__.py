"""YAML nodes to a model, with all errors of the file reported at once.

In: `yaml_tree.YamlNode`
Out: `model.Model` or `diagnostics.ModelError`

`keys` declares the keys of the format once. `document` reads the sections in their order, `entries` each entry,
`namespace` and `scope` give names their meaning, `scalars` checks expressions.
"""
