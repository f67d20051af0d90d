"""Fast Global Registration."""

from typing import Any

import pytest
import torch

from pcrdiff.bindings.open3d_registration import registration
from pcrdiff.geometry.metrics import error_r_deg
from pcrdiff.geometry.rigid import transform
from tests.pcrdiff.methods.small_methods import make_fgr
from tests.pcrdiff.synthetic_clouds import seeded, small_pose, synthetic_pairs


def test_refuses_clouds_without_three_matches() -> None:
    triangle = synthetic_pairs(1, 3, generator=seeded(4))
    with pytest.raises(ValueError, match=r"^fgr "):
        make_fgr().register(triangle.source, triangle.target, generator=seeded(0))


def disc(n: int, radius: float, thickness: float = 0.0) -> torch.Tensor:
    """A round plate, so dense that its turned copies have points within reach anywhere."""
    angle, share = torch.rand(2, n, generator=seeded(6))
    flat = radius * share.sqrt() * torch.stack([(7 * angle).cos(), (7 * angle).sin()])
    return torch.stack([*flat, thickness * torch.randn(n, generator=seeded(7))], dim=-1)


def square(n: int, side: float) -> torch.Tensor:
    return torch.nn.functional.pad(side * torch.rand(n, 2, generator=seeded(8)), (0, 1))


@pytest.mark.parametrize(
    "plate",
    [disc(512, 0.1), disc(1024, 0.2), square(512, 0.2), square(800, 0.3) + 5],
    ids=["disc", "larger", "square", "aside"],
)
@pytest.mark.parametrize("noise", [0.0, 0.001])
def test_the_shift_between_the_centroids_is_no_answer(plate: torch.Tensor, noise: float) -> None:
    pose = small_pose(40, (0.1, -0.2, 0.3))
    target = transform(pose, plate.double()).float()
    target += noise * torch.randn(target.shape, generator=seeded(9))
    with pytest.raises(ValueError, match=r"^fgr needs features that agree on a pose, got none"):
        make_fgr().register(plate[None], target[None], generator=seeded(0))


@pytest.mark.parametrize(
    ("source", "shift"),
    [(disc(512, 0.1), 0.0), (disc(512, 0.1, 0.02), 0.0)]
    + [
        (synthetic_pairs(1, 200, generator=seeded(3)).source[0], shift)
        for shift in (0.0, 0.3, 70.0)
    ],
)
def test_the_shift_is_one_where_it_lays_the_clouds_on_each_other(
    source: torch.Tensor, shift: float
) -> None:
    answer = make_fgr().register(source[None], source[None] + shift, generator=seeded(0))
    assert error_r_deg(answer, torch.eye(4)[None].double()).max() < 0.05
    far = torch.full((3,), shift).double()
    torch.testing.assert_close(answer[0, :3, 3], far, atol=1e-3 * (1 + shift), rtol=0)


def test_open3ds_documented_settings_but_for_the_three_that_are_lengths_and_counts(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    given = []
    fit = registration.registration_fgr_based_on_feature_matching

    def spy(*arguments: Any) -> Any:  # noqa: ANN401  Open3D's
        given.append(arguments[-1])
        return fit(*arguments)

    monkeypatch.setattr(registration, "registration_fgr_based_on_feature_matching", spy)
    pairs = synthetic_pairs(1, 200, generator=seeded(5))
    make_fgr().register(pairs.source, pairs.target, generator=seeded(0))
    (option,) = given
    assert (option.division_factor, option.decrease_mu) == (1.4, False)
    assert (option.tuple_test, option.tuple_scale, option.maximum_tuple_count) == (True, 0.95, 1000)
    assert (option.use_absolute_scale, option.maximum_correspondence_distance) == (True, 0.01)
    assert option.iteration_number == 64
