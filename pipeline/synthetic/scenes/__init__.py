"""Rooms and streets, and the rays that see them."""
