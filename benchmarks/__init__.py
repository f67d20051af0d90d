"""What is fast, how fast, and against whom: measured in one run on one machine."""
