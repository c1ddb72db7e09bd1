"""Which constraints are integrable (D.3), each alone and all together, with what they integrate to.

`classify.classify` is the door: `coupling` parts the rows into groups that share no coordinate, `judge` judges them,
at points of `places` where exact algebra does not decide; `verdict` holds what is found.
"""
