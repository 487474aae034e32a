"""Robots as others describe them (URDF, MJCF), as device files for our components."""
