"""The reader of a row: what its columns or members are called, and the values in them.

Commands, bridges and the gateway read rows with this; the formats of files, messages and bodies are theirs.
"""
