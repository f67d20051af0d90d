"""Random streams: one per purpose, all from the seed in params.yaml."""

import hashlib


def stream(seed: int, purpose: str) -> int:
    """A seed that no other purpose shares, below 2^63."""
    digest = hashlib.sha256(f"{seed}/{purpose}".encode()).digest()
    return int.from_bytes(digest[:7], "big")
