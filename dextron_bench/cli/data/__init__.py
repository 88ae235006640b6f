"""`dextron-bench data`."""
