"""Sweeps: logs times transforms times settings, in parallel, into one Parquet data set."""
