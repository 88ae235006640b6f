"""Atomic files, their hashes, run folders and their configs, and provenance."""
