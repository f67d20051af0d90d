"""The Gaussian process over vectors, independent of any network."""
