"""What every way to the server has in common, described once: reasons of refusals, names, counts.

The standard library only: the command line imports it before it knows what it has to do.
"""
