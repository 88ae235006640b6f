"""What commands share: output, exit codes, wrong usage, groups of flags."""
