"""`dextron-bench compare`."""
