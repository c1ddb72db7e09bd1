"""NumericSystem and State -> rows of the table.

`initial` checks the start, `assembly` moves it to the nearest consistent state by `projection` (steps onto the
constraints) and `search` (from several starts, by IPOPT too), `conflict` names rows that cannot hold together,
`dop853` is the scheme with its coefficients in `tableau`, `grid` says where the rows stand, `driver` takes the
steps. One method a file.
"""
