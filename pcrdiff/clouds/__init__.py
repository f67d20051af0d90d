"""Point clouds and meshes: their files, and points drawn from their surfaces."""
