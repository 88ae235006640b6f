"""Draws the paper's figures and the pictures of pages and docs; the only importer of matplotlib."""
