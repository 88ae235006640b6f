"""What maintainers alone run; it is not part of the wheel."""
