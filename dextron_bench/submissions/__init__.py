"""Submissions: playing an agent, packing its results into a bundle, and verifying the bundle."""
