"""The Gaussian process over vectors; knows no network."""
