"""What is in folders of runs: runs and episodes found, filtered, exported and browsed."""
