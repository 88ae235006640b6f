"""The episodes of many runs on one page, which searches them and opens their recordings."""
