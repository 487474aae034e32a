"""Checks of measured data before anything is fitted: one file a check, one vocabulary (`finding`).

Each says in its docstring what it tests, and how often valid data fail it.
"""
