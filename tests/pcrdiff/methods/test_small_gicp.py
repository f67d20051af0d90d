"""small_gicp from a global start."""

from types import SimpleNamespace

import pytest
import small_gicp
import torch

from pcrdiff.methods.small_gicp import SmallGICP
from tests.pcrdiff.synthetic_clouds import seeded, synthetic_pairs

METHOD = SmallGICP(
    max_iterations=20,
    max_distance=0.05,
    feature_radius=0.3,
    feature_neighbours=128,
    normal_radius=0.2,
)


def test_refuses_clouds_that_the_start_finds_no_three_matches_in() -> None:
    triangle = synthetic_pairs(1, 3, generator=seeded(4))
    with pytest.raises(ValueError, match=r"^\w+ needs 3 matches within 0\.05, got "):
        METHOD.register(triangle.source, 9 * triangle.target, generator=seeded(0))


@pytest.mark.parametrize("matched", ["nothing", "one point"])
def test_the_start_is_no_answer_where_the_library_does_not_improve_it(
    matched: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    pairs = synthetic_pairs(1, 200, generator=seeded(3))
    start = torch.eye(4, dtype=torch.float64)
    start[0, 3] = 50.0
    if matched == "one point":
        p, q = pairs.source[0].double(), pairs.target[0].double()
        start[:3, 3] = q[q[:, 0].argmax()] - p[p[:, 0].argmin()]
    monkeypatch.setattr(SmallGICP, "ransac", lambda *_, **__: start)
    with pytest.raises(ValueError, match=r"^small_gicp needs 3 matches within 0\.05, got [01]$"):
        METHOD.register(pairs.source, pairs.target, generator=seeded(0))


def test_a_start_that_no_step_was_taken_from_is_no_answer(monkeypatch: pytest.MonkeyPatch) -> None:
    def give_up(*_: object, **given: object) -> SimpleNamespace:
        return SimpleNamespace(converged=False, T_target_source=given["init_T_target_source"])

    monkeypatch.setattr(small_gicp, "align", give_up)
    pairs = synthetic_pairs(1, 200, generator=seeded(3))
    noisy = pairs.target + 0.002 * torch.randn(pairs.target.shape, generator=seeded(4))
    with pytest.raises(ValueError, match=r"^small_gicp needs a step that brings the clouds nearer"):
        METHOD.register(pairs.source, noisy, generator=seeded(0))
    answer = METHOD.register(pairs.source, pairs.target, generator=seeded(0))  # lies on it
    torch.testing.assert_close(answer, pairs.T_target_source, atol=1e-5, rtol=0)


def test_a_start_that_cannot_be_bettered_is_an_answer() -> None:
    grid = torch.cartesian_prod(*[torch.linspace(0, 1, 8)] * 3)[None]
    answer = METHOD.register(grid, grid, generator=seeded(0))
    torch.testing.assert_close(answer[0], torch.eye(4).double(), atol=1e-6, rtol=0)


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
