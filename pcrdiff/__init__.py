"""Point cloud registration by diffusion: the library."""
