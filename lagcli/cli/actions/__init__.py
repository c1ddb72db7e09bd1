"""The work of each command: its request goes to the API, and what comes back is printed and written.

In: a request, read models
Out: text on streams, files, `exits.Exit`
"""
