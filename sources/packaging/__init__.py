"""From the equations of a variant to an FMU: C code, plain Python, model description, archive."""
