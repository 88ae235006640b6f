"""`dextron-bench success`."""
