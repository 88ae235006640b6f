"""Files that are whole or absent, their hashes, and the code and versions that made them."""
