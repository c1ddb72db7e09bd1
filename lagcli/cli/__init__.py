"""The command line: commands, options, exit codes, signals, terminal output. No mathematics here.

In: arguments
Out: text or JSON on stdout, messages on stderr, an exit code

`app` is the program and loads the command that is asked for. Each room below imports only from those before it:

- `terminal`: streams, exit codes; `console` is the one place that uses rich
- `commands`: a file a command with its options and what it prints, what several of them share, and the list of all
"""
