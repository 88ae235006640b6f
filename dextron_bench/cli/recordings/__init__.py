"""`dextron-bench recordings`."""
