"""`dextron-bench runs`."""
