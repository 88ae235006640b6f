"""Runs: one method, one seed and one source of reaches, trained, evaluated and recorded."""
