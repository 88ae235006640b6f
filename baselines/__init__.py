"""The baselines of the paper and the floors, one file per method, written as an outside entrant writes them."""
