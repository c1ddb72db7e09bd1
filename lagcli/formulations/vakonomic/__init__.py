"""The motion that makes the action stationary among the motions that satisfy the rows, beside d'Alembert's."""
