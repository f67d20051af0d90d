"""Network parts, and what several methods share."""
