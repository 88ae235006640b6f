"""Processes that this one starts: with the installed code alone, and with limits."""
