"""One random stream per purpose."""

import hashlib

import pytest

from pipeline.settings.seeding import stream


def test_a_stream_is_the_first_seven_bytes_of_a_digest() -> None:
    digest = hashlib.sha256(b"7/train/kitti").hexdigest()
    assert stream(7, "train/kitti") == int(digest[:14], 16)


def test_no_two_purposes_and_no_two_seeds_share_a_stream() -> None:
    streams = [stream(seed, f"{a}/{b}") for seed in range(20) for a in "abc" for b in "def"]
    assert len(set(streams)) == len(streams)


@pytest.mark.parametrize("seed", [0, 1, 2**63])
def test_a_stream_is_a_seed_that_every_generator_takes(seed: int) -> None:
    assert 0 <= stream(seed, "any") < 2**63
