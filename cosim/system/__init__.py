"""Instances and connections: the graph that a master runs, from Python or TOML."""
