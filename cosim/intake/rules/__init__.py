"""What is odd about a column or a clock: one file per kind, all with `check(topic, clock)`.

They look at logs alone, before anybody says what a column is; what a mapping makes of it is checked
again by `calibrate.checks`.
"""
