"""Splits: frozen, hashed lists of cases, how they are loaded and how they are built."""
