"""Numbers over time: recordings, signals, logs of measurements, and how they compare."""
