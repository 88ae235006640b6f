"""The template that `dextron-bench new-agent` copies: a small working agent and its test."""
