"""What `dextron-bench new-agent` copies: a small agent that works, and its test."""
