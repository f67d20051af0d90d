"""A walk that is followed is the walk that is taken."""

from collections.abc import Callable
from pathlib import Path

import pytest
import torch

from pcrdiff.diffusion.process import time_pairs
from pcrdiff.diffusion.sampling import Walk
from pcrdiff.methods.pcrdiffusion_cb import PCRDiffusionCB
from pcrdiff.methods.pcrdiffusion_cf import PCRDiffusionCF
from pipeline.formats.pairs import read_pairs
from pipeline.formats.walks import read_walks, write_walks
from pipeline.settings.params import read_params
from stages.ablate import follow, follow_walks
from tests.pcrdiff.methods.small_methods import make_cb, make_cf
from tests.pcrdiff.synthetic_clouds import seeded, synthetic_pairs
from tests.tiny import CB, CF, PAIRS, SCENARIO, instance, refusal, run_instance
from tests.tiny import weights as weights_file

WALK = Walk(timesteps=20, steps=4, sampler="ddpm")


@pytest.mark.parametrize("make", [make_cf, make_cb])
def test_the_last_prediction_is_the_registration(
    make: Callable[[Walk], PCRDiffusionCF | PCRDiffusionCB],
) -> None:
    method, pairs = make(WALK), synthetic_pairs(1, 40, generator=seeded(0))
    times, noisy, predicted = follow(method, pairs.source, pairs.target, seed=5)
    answer = method.register(pairs.source, pairs.target, generator=seeded(5))
    torch.testing.assert_close(predicted[-1:].float(), answer)
    assert list(times) == [t for t, _ in time_pairs(20, 4)]
    assert noisy.shape == predicted.shape == (4, 4, 4)
    assert not torch.allclose(noisy[0], noisy[-1])


def test_walks_of_pairs_from_first_to_last_are_written_and_read_again(
    project: Path, tmp_path: Path
) -> None:
    weights = weights_file(CF)
    walks = follow_walks(read_params(), CF, read_pairs(project / PAIRS, "test"), weights)
    assert [walk.pair for walk in walks] == [0, 2]
    assert all(len(walk.times) == 3 for walk in walks)
    write_walks(tmp_path / f"{CF}.csv", walks)
    again = read_walks(tmp_path / f"{CF}.csv")
    for ours, theirs in zip(walks, again, strict=True):
        assert (ours.method, ours.pair, ours.times) == (theirs.method, theirs.pair, theirs.times)
        assert (ours.noisy == theirs.noisy).all()
        assert (ours.predicted == theirs.predicted).all()


def test_a_file_with_other_columns_is_refused(tmp_path: Path) -> None:
    (tmp_path / "x.csv").write_text("pair,step\n0,1\n")
    with pytest.raises(ValueError, match="needs the columns pair, step, time"):
        read_walks(tmp_path / "x.csv")


def test_a_method_that_does_not_walk_is_refused(project: Path) -> None:
    from pipeline.formats.weights import write_weights
    from pipeline.loading import build_learned

    params = read_params()
    other = build_learned("dcp_v1", "paper", params.methods, params.diffusion)
    write_weights(Path("dcp.safetensors"), other.state_dict(), {"method": "dcp_v1"})
    with pytest.raises(ValueError, match="dcp_v1 does not walk back from noise"):
        follow_walks(params, "dcp_v1", read_pairs(project / PAIRS, "test"), Path("dcp.safetensors"))


def walks_of(method: str) -> Path:
    """Where the stage writes the walks of a method."""
    return Path(f"results/walks/{SCENARIO}/{method}.csv")


@pytest.mark.parametrize("method", [CF, CB])
def test_writes_every_step_of_a_few_pairs_the_same_bytes_twice(project: Path, method: str) -> None:
    before = (project / walks_of(method)).read_bytes()
    walks = read_walks(walks_of(method))
    assert [(walk.pair, len(walk.times)) for walk in walks] == [(0, 3), (2, 3)]
    walks_of(method).unlink()
    run_instance(instance("ablate_steps"))
    assert (project / walks_of(method)).read_bytes() == before


def test_weights_that_are_not_there_are_named_and_nothing_is_walks_of(project: Path) -> None:
    (project / weights_file(CF)).unlink()
    walks_of(CF).unlink()
    said = refusal("ablate", instance("ablate_steps").argv)
    assert f"weights are needed at {weights_file(CF)}" in said
    assert not walks_of(CF).exists()
