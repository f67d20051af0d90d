"""Shapes of the 40 categories of ModelNet40, and what they are put together from."""
