"""The command line: commands, options, exit codes, signals, terminal output. No mathematics here.

In: arguments
Out: text or JSON on stdout, messages on stderr, an exit code

`app` is the program, `command_group` loads the command that is asked for. Each room below imports only from those
before it:

- `terminal`: streams, exit codes; `console` is the one place that uses rich
- `requests`: what is asked for, checked before any work
- `files`: tables, figures and new models on their way out
- `actions`: what each command does
- `commands`: a file a command with its options, and the list of all
"""
