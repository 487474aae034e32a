"""Logs that nobody has described yet: what is in them, and a mapping to a system made from them.

`sources` reads files of any kind as topics, `guess` and `clock` say what their columns are, `rules`
what is odd about them (one file each), `inspect` puts it together; `matching` finds the variables
of a system that columns are, `writing` writes the data set with its mapping.
"""
