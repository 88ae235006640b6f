"""The errors that the benchmark raises: each is a message to a user, in one line that says what to do.

A class of its own has an error that some caller handles differently, or that carries data. All others are one of the
four kinds here. The command line prints a DextronError and ends with code 2; any other exception is a defect.
"""

from __future__ import annotations


class DextronError(Exception):
    """Any error of this package; its text is for the user."""


class BadInput(DextronError, ValueError):
    """A value, a file or a combination of flags that cannot be used."""


class NotFound(DextronError, LookupError):
    """Something that was asked for by name and is not there."""


class Failed(DextronError, RuntimeError):
    """Work that could not be done, although nothing was wrong with what was asked."""


class MissingPackage(DextronError, ImportError):
    """A library or program that is not installed; the text says how to get it."""
