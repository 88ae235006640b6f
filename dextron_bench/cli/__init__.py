"""The commands of the command line: they parse and print only. Each has its own small module."""
