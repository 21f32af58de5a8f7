"""SIR, PS, DPS, SPS and branched partitioned sampling: one kernel, orderings as data."""
