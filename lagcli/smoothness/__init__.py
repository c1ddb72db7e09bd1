"""Places where expressions are not smooth: one pass over the operations tells what switches, of what kind and where.

In: trees of a model, or CasADi expressions of t, q, v and parameters
Out: switches with their arguments; a verdict on two sides of a point; the first jump on a way

`named_functions` tells from the trees alone what need not be looked for, `time_functions` what depends on t alone.
`operation_graph` walks the operations of an expression, `switches` are those at which it is not smooth, with the pieces
between them; `sides` tells a jump from what is only steep, `jump_search` finds points at which something jumps. What is
done with a switch (a refusal, the end of a step, a stop, a warning) is the matter of those who ask.
"""
