"""Nonholonomy shown: a closed loop in the other coordinates after which one coordinate has moved, as no row that could
be integrated (D.3) allows. What moves a configuration around such loops is the holonomy of the constraints.

`local_system` takes the rows near the one in question, `controlled_paths` integrates paths of piecewise constant
controls and finds the directions that they can reach, `loop_words` proposes and solves for words of moves, `witness`
takes the simplest of them and proves, and `witness_search` asks them in their order.
"""
