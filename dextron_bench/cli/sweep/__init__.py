"""`dextron-bench sweep`."""
