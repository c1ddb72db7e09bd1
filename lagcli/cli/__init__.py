"""The command line: commands, options, exit codes, signals, terminal output. No mathematics here.

In: arguments
Out: text or JSON on stdout, messages on stderr, an exit code

`app` is the program, `commands` has the options of each command, `simulate_command` carries out `simulate`,
`console` is the one place that uses rich, `exits` turns failures into exit codes, `signals` keeps interrupts away
from half-written rows.
"""
