"""Does a function vanish? Exactly, on a surface, or by rigorous numbers, within a limit of time."""
