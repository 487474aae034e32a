"""Reports of diagnoses, calibrations and runs as web pages that need nothing else."""
