"""Sweeps: several settings of a method, each as an ordinary run, compared on `val`; and cross-validation by subject."""
