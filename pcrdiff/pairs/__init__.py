"""Pairs of clouds with known poses: which items, and what is done to them."""
