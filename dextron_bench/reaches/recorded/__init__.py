"""The authors' 575 recordings: download, checks, parsing and cache."""
