"""`make bench`: how fast this project is beside others, measured in one run on one machine."""
