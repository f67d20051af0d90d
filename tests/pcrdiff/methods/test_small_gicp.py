"""small_gicp from a global start."""

import pytest
import small_gicp
import torch

from pcrdiff.methods.small_gicp import SmallGICP
from tests.pcrdiff.made_up_clouds import made_up_pairs, seeded

METHOD = SmallGICP(
    max_iterations=20,
    max_distance=0.05,
    feature_radius=0.3,
    feature_neighbours=128,
    normal_radius=0.2,
)


def test_the_generator_decides_and_open3ds_own_state_does_not() -> None:
    pairs = made_up_pairs(1, 200, generator=seeded(3))
    generator = seeded(0)
    first = METHOD.register(pairs.source, pairs.target, generator=generator)
    METHOD.register(pairs.source, pairs.target, generator=generator)
    again = METHOD.register(pairs.source, pairs.target, generator=seeded(0))
    assert torch.equal(first, again)


def test_refuses_clouds_that_the_start_finds_no_three_matches_in() -> None:
    triangle = made_up_pairs(1, 3, generator=seeded(4))
    with pytest.raises(ValueError, match=r"^\w+ needs 3 matches within 0\.05, got "):
        METHOD.register(triangle.source, 9 * triangle.target, generator=seeded(0))


@pytest.mark.parametrize(
    "default",
    ["registration_type: str = 'GICP'", "max_iterations: * = 20", "num_threads: * = 1"],
)
def test_the_settings_are_the_librarys_own(default: str) -> None:
    name, value = default.split(":")[0], default.split(" = ")[1]
    signatures = small_gicp.align.__doc__.split(", ")
    lines = [line for line in signatures if line.startswith(f"{name}:")]
    assert lines
    assert all(line.endswith(f" = {value}") for line in lines)
