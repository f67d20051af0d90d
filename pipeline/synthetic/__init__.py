"""Synthetic data sets in the official layouts."""
