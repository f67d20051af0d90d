"""One DVC stage is one file."""
