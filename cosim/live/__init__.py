"""A model that runs beside its machine: streams in, residuals, alarms and a data set out."""
