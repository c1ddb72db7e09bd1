"""The door: commands, exit codes, signals, terminal output. No mathematics here.

`app` declares the commands, `running` carries out `simulate`, `console` is the one place that uses rich,
`exits` turns failures into exit codes, `signals` keeps interrupts away from half-written rows.
"""
