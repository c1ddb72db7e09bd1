"""Streams and exit codes: what every command shares with the shell that called it.

In: functions to run, values to print
Out: text on streams, an exit code
"""
