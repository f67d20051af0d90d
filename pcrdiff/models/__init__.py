"""Network parts; know no schedule and no loop."""
