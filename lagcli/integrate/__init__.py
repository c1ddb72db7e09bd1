"""NumericSystem and State -> rows of the table.

`initial` checks or assembles the start, `projection` moves a state onto the constraints far from them,
`dop853` is the scheme with its coefficients in `tableau`, `grid` says where the rows stand, `driver` takes the
steps. One method a file.
"""
