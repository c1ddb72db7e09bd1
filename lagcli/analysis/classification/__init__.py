"""Judge constraints as integrable or not (D.3), each alone and all together, with what they integrate to.

`classify.classify` is the door: `coupling` parts the rows into groups that share no coordinate, `judge` judges them;
`case` holds what is to be judged and what numbers say of it, `verdict` what is found.
"""
