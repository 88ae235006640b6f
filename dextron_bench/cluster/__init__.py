"""Pieces of work as tasks on a cluster: `--cluster` (the only importer of Ray)."""
