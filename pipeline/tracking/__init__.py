"""Journals of what ran, and their way into MLflow."""
