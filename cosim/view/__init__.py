"""Systems in 3D: what the scenes of FMUs look like over the time of a recording."""
