"""Judge constraints as integrable or not (D.3), each alone and all together, with what they integrate to.

`classify.classified` is the way in: `case` parts the rows into groups that share no coordinate and holds what
numbers say of them, `classifier` judges each group, by `locality` where the start may be special, and `verdict` is what
is found. `classify.search` serves runs, which hold the integrals.
"""
