"""The training loop of every learned method."""
