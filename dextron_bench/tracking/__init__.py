"""Trackers: they follow a training by reading its files, and show it in Rerun, TensorBoard, trackio or W&B."""
