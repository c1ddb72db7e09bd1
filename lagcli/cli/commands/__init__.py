"""The commands, a file each: its options, what is refused about them, and how its answer is printed.

In: options
Out: text on streams, files, `exits.Exit`

A new command NAME is a file `NAME_command.py` with a function NAME, and a line here.
"""

COMMANDS = {
    "dof": "Print the number of degrees of freedom.",
    "check": "Classify the constraints, count, check the start.",
    "simulate": "Integrate and write the table of the motion.",
    "animate": "The motion as a page that can be turned, or as a film.",
    "plot": "Draw any columns of tables and models.",
    "sweep": "Many runs: grids, tables and draws of values, on any engine.",
    "compare": "Run a model in several formulations and compare them.",
    "limit": "A constraint as the limit of a stiff spring.",
    "audit": "A second opinion on a run, from its table alone.",
    "displacements": "Allowed and virtual displacements at an instant.",
    "modes": "Small oscillations: frequencies, shapes, stability.",
    "stationary": "Stationary points of a function on the constraint surfaces.",
    "equilibrium": "Points of rest, with multipliers and type.",
    "derive": "Print the equations of motion.",
    "models": "List the gallery, print or copy one of its models.",
    "new": "Write a commented model to start from.",
    "schema": "Print the JSON Schema of model files, for editors.",
    "report": "One page about a model: verdicts, equations, motion, audit.",
    "cache": "Print what is kept of native code, or delete it.",
    "explain": "Explain an error or warning and how to fix it.",
}
