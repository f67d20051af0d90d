"""The vectors that are diffused: their scale, and what a network's output means."""

import pytest
import torch

from pcrdiff.geometry.representation import REPRESENTATIONS, RepresentationName
from pcrdiff.models.pose_space import PoseSpace, Scaling
from tests.pcrdiff.synthetic_clouds import random_poses, seeded

NAMES = list(REPRESENTATIONS)
SCALINGS: list[Scaling] = ["raw", "standardised"]


def fitted(name: RepresentationName, scaling: Scaling) -> PoseSpace:
    space = PoseSpace(name, scaling)
    space.fit(random_poses(200, generator=seeded(0)))
    return space


@pytest.mark.parametrize("name", NAMES)
@pytest.mark.parametrize("scaling", SCALINGS)
def test_a_pose_comes_back(name: RepresentationName, scaling: Scaling) -> None:
    space, T = fitted(name, scaling), random_poses(20, generator=seeded(1))
    torch.testing.assert_close(space.decode(space.encode(T)), T, atol=1e-6, rtol=0)


@pytest.mark.parametrize("name", NAMES)
def test_raw_vectors_are_the_representations_own(name: RepresentationName) -> None:
    space, T = fitted(name, "raw"), random_poses(20, generator=seeded(1))
    assert torch.equal(space.encode(T), REPRESENTATIONS[name].encode(T))


@pytest.mark.parametrize("name", NAMES)
def test_standardised_training_poses_have_mean_0_and_deviation_1(name: RepresentationName) -> None:
    x = fitted(name, "standardised").encode(random_poses(200, generator=seeded(0)))
    torch.testing.assert_close(x.mean(dim=0), torch.zeros_like(x[0]), atol=1e-6, rtol=0)
    torch.testing.assert_close(x.std(dim=0, correction=0), torch.ones_like(x[0]))


def test_an_entry_that_does_not_vary_is_not_blown_up() -> None:
    space = PoseSpace("matrix", "standardised")
    space.fit(torch.eye(4, dtype=torch.float64).expand(5, 4, 4))
    assert space.deviation.min() > 0
    assert torch.isfinite(space.encode(random_poses(3, generator=seeded(2)))).all()


@pytest.mark.parametrize("name", NAMES)
def test_no_step_leads_to_the_identity_or_to_the_mean(name: RepresentationName) -> None:
    raw = PoseSpace(name, "raw")
    nothing = torch.zeros(3, raw.dim)
    torch.testing.assert_close(raw.decode(raw.step(nothing)), torch.eye(4).expand(3, 4, 4))
    if REPRESENTATIONS[name].tidy(raw.start + 1).equal(raw.start + 1):  # tidying moves the mean
        standardised = fitted(name, "standardised")
        torch.testing.assert_close(standardised.step(nothing), nothing)


@pytest.mark.parametrize("scaling", SCALINGS)
def test_the_quaternion_of_an_answer_has_unit_length(scaling: Scaling) -> None:
    space = fitted("quaternion", scaling)
    x = space.step(torch.randn(50, 7, generator=seeded(3)))
    quaternion = (x * space.deviation + space.mean)[:, :4]
    torch.testing.assert_close(quaternion.norm(dim=-1), torch.ones(50))


def test_the_scale_is_part_of_the_weights() -> None:
    space, other = fitted("twist", "standardised"), PoseSpace("twist", "standardised")
    other.load_state_dict(space.state_dict())
    T = random_poses(4, generator=seeded(4))
    assert torch.equal(other.encode(T), space.encode(T))
