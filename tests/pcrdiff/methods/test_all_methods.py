"""What every row of the table promises, whatever it does."""

import pytest
import torch
from torch import Tensor

from pcrdiff.geometry.metrics import error_r_deg, error_t
from pcrdiff.geometry.rigid import invert, transform
from pcrdiff.registration import LearnedMethod, Method
from tests.pcrdiff.methods.small_methods import (
    CLASSICAL,
    DIFFUSED,
    FROM_THE_MODE,
    LEARNED,
    make_method,
)
from tests.pcrdiff.synthetic_clouds import (
    lopsided_clouds,
    random_poses,
    seeded,
    small_pose,
    synthetic_pairs,
)

every_method = pytest.mark.parametrize("name", [*CLASSICAL, *LEARNED])
every_learned_method = pytest.mark.parametrize("name", LEARNED)
FOLLOW_ANY_MOTION = ("fgr", "ransac_fpfh", "small_gicp", "kiss_matcher", "deepgmr")
"""Their answer on exact copies follows the target wherever it goes."""
GLOBAL = ("fgr", "ransac_fpfh", "small_gicp", "kiss_matcher")
"""They solve dense exact copies from anywhere."""
searching = pytest.mark.parametrize("name", [*CLASSICAL][2:])
"""Those that answer by what they find in the clouds."""
FROM_THE_CENTROIDS = ("icp_centroid", "trimmed_icp")
"""They solve exact copies to the last digits, from the shift between the centroids."""
FOLLOW_NO_SHIFT = ("identity", "constant", "icp", "pcrdiffusion_cf", "pcrdiffusion_cb")
"""They look at where the clouds lie in space, or at nothing at all."""


def clouds(n: int = 64, m: int = 64, batch: int = 3) -> tuple[Tensor, Tensor]:
    """Exact copies in another order, but for the points that only the longer one has."""
    pairs = synthetic_pairs(batch, max(n, m), generator=seeded(0))
    return pairs.source[:, :n], pairs.target[:, :m]


def assert_rigid(pose: Tensor, batch: int) -> None:
    assert pose.shape == (batch, 4, 4)
    R = pose[:, :3, :3].double()
    eye = torch.eye(3, dtype=torch.float64).expand_as(R)
    torch.testing.assert_close(R @ R.mT, eye, atol=2e-6, rtol=0)
    ones = torch.ones(batch, dtype=torch.float64)
    torch.testing.assert_close(torch.det(R), ones, atol=2e-6, rtol=0)
    assert (pose[:, 3].double() == torch.tensor([0.0, 0, 0, 1])).all()


@every_method
def test_bears_its_name_and_is_a_method(name: str) -> None:
    method = make_method(name)
    assert method.name == name
    assert isinstance(method, Method)


@every_method
@pytest.mark.parametrize(("n", "m"), [(64, 64), (160, 200), (200, 160)])
def test_answers_a_rigid_pose_for_clouds_of_equal_and_unequal_size(
    name: str, n: int, m: int
) -> None:
    source, target = clouds(n, m)
    assert_rigid(make_method(name).register(source, target, generator=seeded(1)), 3)


@every_method
def test_answers_the_same_under_one_seed_and_leaves_the_clouds_alone(name: str) -> None:
    source, target = clouds()
    first = make_method(name).register(source, target, generator=seeded(1))
    again = make_method(name).register(source, target, generator=seeded(1))
    assert torch.equal(first, again)
    for cloud, untouched in zip((source, target), clouds(), strict=True):
        assert torch.equal(cloud, untouched)


@every_method
def test_a_batch_is_a_loop_over_its_items(name: str) -> None:
    source, target = clouds()
    method, generator = make_method(name), seeded(1)
    loop = [
        method.register(source[k : k + 1], target[k : k + 1], generator=generator) for k in range(3)
    ]
    batch = method.register(source, target, generator=seeded(1))
    exact = name in CLASSICAL  # the sums of a larger matrix product are cut otherwise
    torch.testing.assert_close(torch.cat(loop), batch, atol=0 if exact else 1e-4, rtol=0)


@every_method
@pytest.mark.parametrize("which", ["source", "target"])
@pytest.mark.parametrize(
    ("trouble", "said"),
    [
        ("empty", "at least \\d+ distinct points, got a {} cloud of 0"),
        ("one point", "at least \\d+ distinct points, got a {} cloud of 1"),
        ("one point again and again", "at least \\d+ distinct points, got a {} cloud of 1"),
        ("one of the batch", "at least \\d+ distinct points, got a {} cloud of 2"),
        ("nan", "finite points, got a {} cloud with NaN or infinity"),
        ("infinity", "finite points, got a {} cloud with NaN or infinity"),
    ],
)
def test_refuses_clouds_that_no_pose_can_be_read_from(
    name: str, which: str, trouble: str, said: str
) -> None:
    pair = dict(zip(("source", "target"), clouds(batch=2), strict=True))
    cloud = pair[which].clone()
    if trouble == "one of the batch":
        cloud[1, 2:] = cloud[1, 1]
    elif trouble in ("nan", "infinity"):
        cloud[1, 5, 2] = float(trouble)
    else:
        cloud = {
            "empty": cloud[:, :0],
            "one point": cloud[:, :1],
            "one point again and again": cloud[:, :1].repeat(1, 9, 1),
        }[trouble]
    pair[which] = cloud
    with pytest.raises(ValueError, match=f"^{name} needs " + said.format(which)):
        make_method(name).register(**pair, generator=seeded(1))


@searching
@pytest.mark.parametrize("shape", ["line", "two heaps", "three heaps in a row"])
def test_clouds_that_can_be_turned_unseen_are_a_failure_with_a_reason(
    name: str, shape: str
) -> None:
    heap = 1e-8 * torch.randn(100, 3, generator=seeded(6), dtype=torch.float64)
    way = torch.tensor([[0.3, -0.2, 0.1]], dtype=torch.float64)
    source = {
        "line": torch.linspace(-1, 1, 100, dtype=torch.float64)[:, None] * way,
        "two heaps": heap + way * (torch.arange(100) % 2)[:, None],
        "three heaps in a row": heap + way * (torch.arange(100) % 3)[:, None],
    }[shape]
    for pose in (small_pose(0, (0.0, 0.0, 0.0)), small_pose(20, (0.01, 0.0, 0.02))):
        clouds = source[None], transform(pose[None], source[None])
        with pytest.raises(ValueError, match=f"^{name} needs "):
            make_method(name).register(*clouds, generator=seeded(1))


@searching
@pytest.mark.parametrize("shape", ["potato", "plate"])
def test_clouds_that_lie_right_already_are_no_failure(name: str, shape: str) -> None:
    source = lopsided_clouds(1, 512, generator=seeded(7))
    if shape == "plate":
        source = source * torch.tensor([1.0, 1.0, 0.0])
    answer = make_method(name).register(source, source, generator=seeded(1))
    here = torch.eye(4, dtype=torch.float64)[None]
    assert error_r_deg(answer.double(), here).max() < 0.05
    assert error_t(answer.double(), here).max() < 1e-3


@every_method
def test_refuses_an_empty_batch(name: str) -> None:
    nothing = torch.zeros(0, 20, 3)
    with pytest.raises(ValueError, match=f"^{name} needs "):
        make_method(name).register(nothing, nothing, generator=seeded(1))


@every_learned_method
def test_a_learned_method_does_not_depend_on_the_order_of_the_points(name: str) -> None:
    source, target = clouds()
    g = seeded(2)
    shuffled = (
        source[:, torch.randperm(64, generator=g)],
        target[:, torch.randperm(64, generator=g)],
    )
    method = make_method(name)
    answer = method.register(source, target, generator=seeded(1))
    torch.testing.assert_close(
        method.register(*shuffled, generator=seeded(1)), answer, atol=1e-4, rtol=0
    )


@every_learned_method
def test_a_learned_method_sees_both_clouds_and_a_diffused_one_follows_its_generator(
    name: str,
) -> None:
    source, target = clouds()
    other = lopsided_clouds(3, 64, generator=seeded(3))
    method = make_method(name)
    answer = method.register(source, target, generator=seeded(1))
    for changed in (
        method.register(other, target, generator=seeded(1)),
        method.register(source, other, generator=seeded(1)),
    ):
        assert not torch.allclose(changed, answer, atol=1e-5)
    drawn_again = method.register(source, target, generator=seeded(2))
    assert torch.allclose(drawn_again, answer, atol=1e-5) == (name not in DIFFUSED)


@every_learned_method
def test_a_learned_method_registers_without_a_gradient_and_its_loss_reaches_all_weights(
    name: str,
) -> None:
    method, pairs = make_method(name), synthetic_pairs(3, 64, generator=seeded(0))
    assert isinstance(method, LearnedMethod)
    answer = method.register(pairs.source, pairs.target, generator=seeded(1))
    assert not answer.requires_grad
    terms = method.loss(pairs, generator=seeded(1))
    assert all(term.shape == () and torch.isfinite(term) for term in terms.values())
    torch.autograd.backward(torch.stack(list(terms.values())).sum())
    for parameter_name, parameter in method.named_parameters():
        assert parameter.grad is not None, parameter_name
        assert torch.isfinite(parameter.grad).all(), parameter_name
        assert parameter.grad.abs().max() > 0, parameter_name


@every_learned_method
def test_the_loss_of_a_learned_method_follows_its_generator(name: str) -> None:
    method, pairs = make_method(name), synthetic_pairs(3, 64, generator=seeded(0))
    assert isinstance(method, LearnedMethod)
    first, again, other = (method.loss(pairs, generator=seeded(k)) for k in (1, 1, 2))
    assert {k: v.item() for k, v in first.items()} == {k: v.item() for k, v in again.items()}
    if name in (*DIFFUSED, *FROM_THE_MODE):
        term = "diffusion" if name in DIFFUSED else "points"
        assert first[term] != other[term]


@pytest.mark.parametrize("name", FOLLOW_ANY_MOTION)
def test_the_answer_follows_any_motion_of_the_target(name: str) -> None:
    pairs = synthetic_pairs(3, 200, generator=seeded(4))
    A = random_poses(3, generator=seeded(5))
    moved = transform(A, pairs.target.double()).float()
    answer = make_method(name).register(pairs.source, pairs.target, generator=seeded(1))
    follows = make_method(name).register(pairs.source, moved, generator=seeded(1))
    assert error_r_deg(follows.double(), A @ answer.double()).max() < 0.1
    assert error_t(follows.double(), A @ answer.double()).max() < 2e-3


@pytest.mark.parametrize("name", [*CLASSICAL, *LEARNED])
def test_the_answer_follows_a_shift_of_the_target_unless_its_place_is_what_is_read(
    name: str,
) -> None:
    source, target = clouds()
    shift = small_pose(0, (0.7, -0.4, 0.2))
    method = make_method(name)
    answer = method.register(source, target, generator=seeded(1)).double()
    moved = target + shift[:3, 3].float()
    follows = method.register(source, moved, generator=seeded(1)).double()
    close = torch.allclose(follows, shift @ answer, atol=5e-4)
    assert close == (name not in FOLLOW_NO_SHIFT)


@pytest.mark.parametrize(
    ("name", "points", "degrees", "length"),
    [
        *((name, 512, 0.05, 1e-3) for name in GLOBAL),
        *((name, 300, 0.01, 1e-4) for name in FROM_THE_CENTROIDS),
    ],
)
def test_solves_exact_copies(name: str, points: int, degrees: float, length: float) -> None:
    pairs = synthetic_pairs(4, points, generator=seeded(0))
    answer = make_method(name).register(pairs.source, pairs.target, generator=seeded(0))
    assert error_r_deg(answer, pairs.T_target_source).max() < degrees
    assert error_t(answer, pairs.T_target_source).max() < length


@pytest.mark.parametrize("name", GLOBAL)
def test_the_answer_on_dense_copies_follows_any_motion_of_the_target_closely(name: str) -> None:
    pairs = synthetic_pairs(3, 512, generator=seeded(1))
    source, target = pairs.source.double(), pairs.target.double()
    A = random_poses(3, generator=seeded(2))
    method = make_method(name)
    answer = method.register(source, target, generator=seeded(0))
    moved = method.register(source, transform(A, target), generator=seeded(0))
    assert error_r_deg(moved, A @ answer).max() < 0.05
    assert error_t(moved, A @ answer).max() < 1e-3


@pytest.mark.parametrize("name", ["fgr", "small_gicp"])
def test_the_generator_decides_and_the_state_of_open3d_does_not(name: str) -> None:
    pairs, method = synthetic_pairs(1, 200, generator=seeded(3)), make_method(name)
    generator = seeded(0)
    first = method.register(pairs.source, pairs.target, generator=generator)
    method.register(pairs.source, pairs.target, generator=generator)
    again = method.register(pairs.source, pairs.target, generator=seeded(0))
    assert torch.equal(first, again)


@pytest.mark.parametrize("name", FROM_THE_CENTROIDS)
def test_a_translation_however_long_is_seen_through(name: str) -> None:
    pairs = synthetic_pairs(3, 200, generator=seeded(1))
    source, target = pairs.source.double(), pairs.target.double()
    shift = small_pose(0, (70.0, -40.0, 10.0)).expand(3, 4, 4)
    method = make_method(name)
    answer = method.register(source, target, generator=seeded(0))
    moved = method.register(source, transform(shift, target), generator=seeded(0))
    torch.testing.assert_close(moved, shift @ answer, atol=1e-7, rtol=0)


@pytest.mark.parametrize("name", FROM_THE_CENTROIDS)
def test_the_answer_follows_when_both_clouds_move_together(name: str) -> None:
    pairs = synthetic_pairs(3, 200, generator=seeded(3))
    source, target = pairs.source.double(), pairs.target.double()
    A = random_poses(3, generator=seeded(4))
    method = make_method(name)
    answer = method.register(source, target, generator=seeded(0))
    moved = method.register(transform(A, source), transform(A, target), generator=seeded(0))
    torch.testing.assert_close(moved, A @ answer @ invert(A), atol=1e-7, rtol=0)
