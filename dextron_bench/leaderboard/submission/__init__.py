"""Submissions: agents tried by anyone, the bundles that tell of it, and how anyone checks them."""
