"""The verbs of the command line: parsing and printing only. One small module each."""
