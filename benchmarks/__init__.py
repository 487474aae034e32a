"""Measurements of the program; cosim is imported first, since it chooses the arithmetic."""

import cosim  # noqa: F401
