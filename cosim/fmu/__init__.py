"""One FMU: its archive, what it says about itself, an instance of it, exchange of values."""
