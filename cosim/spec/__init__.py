"""What sources and cosim both must know: names of variants, units, cache, extras of an FMU."""
