"""Requests of commands, each as one frozen object, and refusals before any work.

In: options of a command
Out: `SimulateOptions` and its like, or `exits.UsageError`
"""
