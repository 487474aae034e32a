"""Machines of the papers as plants of their own, which make logs: no FMU, and no equation of one.

Written from the papers and handbooks with NumPy and SciPy alone, so that what explains the logs is
not what made them.
"""
