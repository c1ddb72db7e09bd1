"""Singular configurations on the way: predicted, and the step that leads across one.

In: the rows and states of a run
Out: when rows become dependent, what is lost there, and the states on the other side
"""
