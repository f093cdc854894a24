"""Commands: parse, seed, make a run folder, call one function.

``main`` finds a command by name, ``experiment`` keeps its arguments, versions and results, ``tables`` shows rows; every
other file is one command.
"""
