"""Rotations, rigid transforms and the neighbourhoods of points."""
