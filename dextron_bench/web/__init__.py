"""Pages on this machine: a server on loopback, HTML with escapes, SVG, Rerun's web viewer as a site."""
