"""Tables in files: written and read back."""
