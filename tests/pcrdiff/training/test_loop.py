"""The training loop: resumable byte for byte, its rates by hand, its best weights the best."""

import math
from collections.abc import Mapping
from dataclasses import replace
from typing import Literal

import numpy as np
import pytest
import torch
from torch import Tensor, nn

from pcrdiff.geometry.metrics import error_r_deg, error_t
from pcrdiff.geometry.random_pose import PoseRange
from pcrdiff.geometry.rigid import from_pose_vector, transform
from pcrdiff.models.losses import pose_loss
from pcrdiff.registration import LearnedMethod, Pairs
from pcrdiff.training.budget import FLOOR, WARM_UP, Budget, halvings
from pcrdiff.training.loop import Trainer, train
from pcrdiff.training.poses import repose
from tests.pcrdiff.synthetic_clouds import seeded, synthetic_pairs

BUDGET = Budget(
    epochs=4, batch_size=4, learning_rate=0.01, schedule="plateau", patience=1, validate_every=1
)
FRESH = PoseRange(max_rotation=0.5, max_translation=0.5)


class Tiny(LearnedMethod):
    """Learns from where the centroids lie, and draws from its generator while it does."""

    name = "tiny"

    def __init__(self) -> None:
        super().__init__()
        torch.manual_seed(0)
        self.layers = nn.Sequential(nn.Linear(6, 8), nn.ReLU(), nn.Linear(8, 7))

    def predict(self, source: Tensor, target: Tensor) -> Tensor:
        """A pose per pair."""
        moments = torch.cat([source.mean(dim=1), target.mean(dim=1)], dim=-1)
        identity = torch.tensor([1.0, 0, 0, 0, 0, 0, 0])
        return from_pose_vector(self.layers(moments) + identity)

    def loss(self, pairs: Pairs, *, generator: torch.Generator) -> Mapping[str, Tensor]:
        """Two terms, on points that noise has moved."""
        noise = 0.01 * torch.randn(pairs.source.shape, generator=generator)
        estimate = self.predict(pairs.source + noise, pairs.target)
        pose = pose_loss(estimate, pairs.T_target_source.float())
        size = 1e-3 * torch.stack([p.square().sum() for p in self.parameters()]).sum()
        return {"pose": pose, "size": size}

    def answer(self, source: Tensor, target: Tensor, *, generator: torch.Generator) -> Tensor:
        """As :class:`pcrdiff.registration.Method` asks."""
        del generator
        return self.predict(source, target)


class Memory:
    """A checkpoint that lives in memory, and a training that is killed after some epochs."""

    def __init__(self, killed_after: int | None = None) -> None:
        self.kept: tuple[dict[str, Tensor], dict[str, object]] | None = None
        self.saves, self.killed_after = 0, killed_after

    def load(self) -> tuple[dict[str, Tensor], dict[str, object]] | None:
        """What was saved last."""
        return self.kept

    def due(self) -> bool:
        """Always."""
        return True

    def save(self, tensors: Mapping[str, Tensor], record: Mapping[str, object]) -> None:
        """As a file would: nothing of it changes afterwards."""
        self.kept = {name: value.clone() for name, value in tensors.items()}, dict(record)
        self.saves += 1
        if self.saves == self.killed_after:
            raise KeyboardInterrupt


def make_trainer(
    budget: Budget = BUDGET, fresh: PoseRange | None = FRESH, seed: int = 3
) -> Trainer:
    pairs = synthetic_pairs(10, 16, generator=seeded(0))
    val = synthetic_pairs(3, 16, generator=seeded(1))
    return Trainer(Tiny(), pairs, val, budget, fresh, seed=seed)


def weights_of(trainer: Trainer) -> bytes:
    return b"".join(value.numpy().tobytes() for value in trainer.method.state_dict().values())


@pytest.mark.parametrize("schedule", ["plateau", "cosine"])
@pytest.mark.parametrize("killed_after", [1, 3])
def test_a_killed_training_ends_with_the_same_bytes(
    schedule: Literal["plateau", "cosine"], killed_after: int
) -> None:
    budget = replace(BUDGET, schedule=schedule)
    whole = make_trainer(budget)
    best, curve = train(whole, Memory())

    checkpoint = Memory(killed_after)
    with pytest.raises(KeyboardInterrupt):
        train(make_trainer(budget), checkpoint)
    resumed = make_trainer(budget)
    with torch.no_grad():
        for parameter in resumed.method.parameters():
            parameter.fill_(7.0)  # what was there before must not matter
    best_resumed, curve_resumed = train(resumed, checkpoint)

    assert weights_of(resumed) == weights_of(whole)
    assert curve_resumed == curve
    assert list(best_resumed) == list(best)
    assert all(torch.equal(best_resumed[name], best[name]) for name in best)
    assert (resumed.state.best_error, resumed.state.best_epoch) == (
        whole.state.best_error,
        whole.state.best_epoch,
    )


def test_a_finished_training_has_nothing_left_to_do() -> None:
    checkpoint = Memory()
    best, curve = train(make_trainer(), checkpoint)
    again, curve_again = train(make_trainer(), checkpoint)
    assert checkpoint.saves == BUDGET.epochs
    assert curve_again == curve
    assert all(torch.equal(again[name], best[name]) for name in best)


def test_the_seed_decides() -> None:
    first, again, other = make_trainer(), make_trainer(), make_trainer(seed=4)
    for trainer in (first, again, other):
        train(trainer, Memory())
    assert weights_of(first) == weights_of(again)
    assert weights_of(first) != weights_of(other)


def test_an_epoch_steps_over_every_pair_once_in_another_order() -> None:
    trainer = make_trainer(fresh=None)
    epochs = [[pairs for _, pairs in trainer._batches(epoch)] for epoch in range(2)]
    for batches in epochs:
        assert [len(batch) for batch in batches] == [4, 4, 2] == [4] * 2 + [2]
        assert sorted(torch.cat([batch.item for batch in batches]).tolist()) == list(range(10))
    assert trainer.steps_per_epoch == 3
    assert epochs[0][0].item.tolist() != epochs[1][0].item.tolist()


def test_fresh_poses_differ_between_epochs_and_not_with_the_batch_size() -> None:
    def poses(batch_size: int, epoch: int) -> Tensor:
        trainer = make_trainer(replace(BUDGET, batch_size=batch_size))
        batches = [pairs for _, pairs in trainer._batches(epoch)]
        order = torch.cat([batch.item for batch in batches]).argsort()
        return torch.cat([batch.T_target_source for batch in batches])[order]

    assert torch.equal(poses(4, 0), poses(10, 0))
    assert (poses(4, 0) != poses(4, 1)).flatten(1).any(dim=1).all()


def test_a_new_pose_keeps_a_pair_of_copies_consistent() -> None:
    pairs = synthetic_pairs(6, 16, generator=seeded(0))
    generators = [np.random.default_rng(k) for k in range(6)]
    moved = repose(pairs, FRESH, generators)
    assert not torch.allclose(moved.T_target_source, pairs.T_target_source)
    assert moved.target.dtype == torch.float32
    carried = transform(moved.T_target_source, pairs.source.double())
    gaps = torch.cdist(moved.target.double(), carried).min(dim=-1).values
    assert gaps.max() < 1e-6
    assert torch.equal(moved.source, pairs.source)
    assert torch.equal(moved.item, pairs.item)
    assert (moved.T_target_source[:, :3, 3] >= 0).all()
    assert (moved.T_target_source[:, :3, 3] <= 0.5).all()


def test_a_new_pose_turns_the_normals_of_the_target_with_it() -> None:
    pairs = synthetic_pairs(6, 16, generator=seeded(0))
    outward = nn.functional.normalize(pairs.source, dim=-1)
    still = torch.eye(4, dtype=torch.float64).repeat(6, 1, 1)
    pairs = replace(
        pairs,
        target=pairs.source,
        T_target_source=still,
        source_normals=outward,
        target_normals=outward,
    )
    moved = repose(pairs, FRESH, [np.random.default_rng(k) for k in range(6)])
    again = repose(moved, FRESH, [np.random.default_rng(k) for k in range(6, 12)])
    for new in (moved, again):
        assert new.source_normals is outward
        assert new.target_normals is not None
        t = new.T_target_source[:, None, :3, 3]
        directions = nn.functional.normalize(new.target.double() - t, dim=-1)
        torch.testing.assert_close(new.target_normals.double(), directions, atol=1e-6, rtol=0)


def test_a_method_with_given_normals_is_validated_with_them() -> None:
    shown: set[int] = set()

    class Oriented(Tiny):
        normals = "given"

        def answer(self, source: Tensor, target: Tensor, *, generator: torch.Generator) -> Tensor:
            """As :class:`pcrdiff.registration.Method` asks."""
            shown.update({source.shape[-1], target.shape[-1]})
            return super().answer(source[..., :3], target[..., :3], generator=generator)

    plain = make_trainer()
    val = plain.validation.pairs
    val = replace(val, source_normals=val.source, target_normals=val.target)
    method = Oriented()
    Trainer(method, plain.train, val, BUDGET, FRESH, seed=3).run_epoch(0)
    assert shown == {6}
    with pytest.raises(ValueError, match="the pairs hold no normals"):
        Trainer(method, plain.train, plain.validation.pairs, BUDGET, FRESH, seed=3).run_epoch(0)


def test_the_weights_that_are_kept_are_those_of_the_lowest_validation_error() -> None:
    class Watched(Trainer):
        """Takes its validation errors from a list, and remembers its weights."""

        def __init__(self, told: list[float]) -> None:
            plain = make_trainer(replace(BUDGET, epochs=len(told)))
            super().__init__(
                plain.method, plain.train, plain.validation.pairs, plain.budget, None, seed=3
            )
            self.told, self.seen = told, list[bytes]()

            self.validation.errors = self.errors  # type: ignore[method-assign]

        def errors(self, method: LearnedMethod) -> tuple[float, float]:
            self.seen.append(weights_of(self))
            assert method is self.method
            return self.told[len(self.seen) - 1], 0.0

    trainer = Watched([5.0, 2.0, math.nan, 2.0, 3.0])
    best, _ = train(trainer, Memory())
    kept = b"".join(value.numpy().tobytes() for value in best.values())
    assert trainer.state.best_epoch == 1
    assert trainer.state.best_error == 2.0
    assert kept == trainer.seen[1]
    assert len(set(trainer.seen)) == 5


def test_validation_is_the_mean_error_over_the_validation_pairs() -> None:
    trainer = make_trainer()
    _, curve = train(trainer, Memory())
    estimate = trainer.method.register(
        trainer.validation.pairs.source, trainer.validation.pairs.target, generator=seeded(0)
    ).double()
    truth = trainer.validation.pairs.T_target_source
    assert curve[-1].val_error_r_deg == pytest.approx(error_r_deg(estimate, truth).mean().item())
    assert curve[-1].val_error_t == pytest.approx(error_t(estimate, truth).mean().item())


def test_validates_when_due_and_after_the_last_epoch() -> None:
    _, curve = train(make_trainer(replace(BUDGET, epochs=5, validate_every=2)), Memory())
    looked = [epoch.val_error_r_deg is not None for epoch in curve]
    assert looked == [False, True, False, True, True]
    assert [epoch.epoch for epoch in curve] == [0, 1, 2, 3, 4]
    assert [epoch.step for epoch in curve] == [3, 6, 9, 12, 15]


def test_a_curve_holds_each_term_and_their_sum() -> None:
    _, curve = train(make_trainer(), Memory())
    for epoch in curve:
        assert set(epoch.losses) == {"loss", "pose", "size"}
        assert epoch.losses["loss"] == pytest.approx(epoch.losses["pose"] + epoch.losses["size"])


def test_the_loss_of_an_epoch_weighs_pairs_and_not_batches() -> None:
    still = replace(BUDGET, learning_rate=0.0)
    whole = make_trainer(replace(still, batch_size=10), fresh=None)
    parts = make_trainer(still, fresh=None)
    for trainer in (whole, parts):
        trainer.run_epoch(0)
    by_hand = pose_loss(
        whole.method.predict(whole.train.source, whole.train.target),  # type: ignore[operator]
        whole.train.T_target_source.float(),
    ).item()
    assert parts.state.curve[0].losses["pose"] == pytest.approx(
        by_hand, rel=0.02
    )  # but for the noise
    assert whole.state.curve[0].losses["pose"] == pytest.approx(by_hand, rel=0.02)


def test_the_loss_falls_on_a_tiny_set() -> None:
    _, curve = train(make_trainer(replace(BUDGET, epochs=60, patience=60), fresh=None), Memory())
    assert curve[-1].losses["pose"] < 0.5 * curve[0].losses["pose"]


@pytest.mark.parametrize("value", [math.nan, math.inf])
def test_refuses_a_gradient_that_is_not_finite_and_keeps_the_weights(value: float) -> None:
    trainer = make_trainer(fresh=None)
    trainer.train.source[3] = value
    trainer.budget = replace(BUDGET, batch_size=10)
    before = weights_of(trainer)
    with pytest.raises(RuntimeError, match="non-finite"):
        trainer.run_epoch(0)
    assert weights_of(trainer) == before


MARK = 77.0


def broken(how: str, weight: Tensor) -> Tensor:
    """A term that is not finite, or whose gradient is not, or that LAPACK refuses."""
    if how == "decomposition":
        values: Tensor = torch.linalg.eigvalsh(weight * torch.full((3, 3), math.nan))
        return values.sum()
    return {
        "loss": 0 * weight * math.nan,
        "overflow": weight + math.inf,
        "gradient": (0 * weight).sqrt(),  # 0, of infinite slope
    }[how]


@pytest.mark.parametrize("how", ["loss", "overflow", "gradient", "decomposition"])
def test_what_is_not_finite_is_said_with_the_items_of_its_batch(
    how: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Pairs 0 to 9 show items 100 to 109; that of pair 3 breaks."""
    whole, plain, batches = make_trainer(fresh=None), Tiny.loss, list[list[int]]()
    whole.train.source[3] = MARK

    def breaking(self: Tiny, pairs: Pairs, *, generator: torch.Generator) -> Mapping[str, Tensor]:
        batches.append(pairs.item.tolist())
        terms = plain(self, pairs, generator=generator)
        if not (pairs.source == MARK).any():
            return terms
        return {**terms, "broken": broken(how, next(self.parameters()).sum())}

    monkeypatch.setattr(Tiny, "loss", breaking)
    pairs = replace(whole.train, item=torch.arange(100, 110))
    trainer = Trainer(Tiny(), pairs, whole.validation.pairs, BUDGET, None, seed=3)
    with pytest.raises(RuntimeError, match=r"^tiny needs a finite loss and gradient, ") as refused:
        trainer.run_epoch(0)
    assert 103 in batches[-1]
    assert f" in epoch 0 from the pairs of items {batches[-1]}: " in str(refused.value)
    assert all(torch.isfinite(value).all() for value in trainer.method.state_dict().values())


def test_halvings_worked_by_hand() -> None:
    assert halvings([], 0) == 0
    assert halvings([3.0, 2.0, 1.0], 0) == 0
    assert halvings([1.0, 1.0], 0) == 1
    assert halvings([1.0, 0.9, 0.9, 0.9], 2) == 0  # waited twice
    assert halvings([1.0, 0.9, 0.9, 0.9, 0.9], 2) == 1  # waited three times
    assert halvings([1.0, 2.0, 2.0, 2.0, 2.0, 2.0, 2.0], 2) == 2
    assert halvings([1.0, 2.0, 2.0, 0.5, 2.0, 2.0, 2.0], 2) == 1  # a better loss starts anew


@pytest.mark.parametrize("patience", [0, 1, 3])
def test_halvings_agree_with_torchs_plateau(patience: int) -> None:
    losses = torch.rand(60, generator=seeded(patience)).tolist()
    optimizer = torch.optim.SGD([torch.zeros(1, requires_grad=True)], lr=1.0)
    plateau = torch.optim.lr_scheduler.ReduceLROnPlateau(
        optimizer, factor=0.5, patience=patience, threshold=0.0, eps=0.0
    )
    for k, loss in enumerate(losses):
        plateau.step(loss)
        assert optimizer.param_groups[0]["lr"] == 0.5 ** halvings(losses[: k + 1], patience)


def test_the_plateau_schedule_halves_the_rate_of_the_next_epoch() -> None:
    trainer = make_trainer(replace(BUDGET, epochs=30, patience=0))
    _, curve = train(trainer, Memory())
    losses = [epoch.losses["loss"] for epoch in curve]
    for k, epoch in enumerate(curve):
        assert epoch.learning_rate == 0.01 * 0.5 ** halvings(losses[:k], 0)
    assert curve[-1].learning_rate < 0.01


def test_the_cosine_schedule_rises_and_falls_as_worked_by_hand() -> None:
    trainer = make_trainer(replace(BUDGET, epochs=100, schedule="cosine"))
    assert trainer.learning_rate(0, 0) == pytest.approx(0.01 * FLOOR)
    assert trainer.learning_rate(50, 0) == pytest.approx(0.01 * (FLOOR + (1 - FLOOR) / 2))
    assert trainer.learning_rate(100, 0) == pytest.approx(0.01 * FLOOR)
    rates = [trainer.learning_rate(epoch, batch) for epoch in range(100) for batch in range(3)]
    peak = int(np.argmax(rates))
    assert peak / 300 == pytest.approx(WARM_UP, abs=0.01)
    assert (np.diff(rates[:peak]) > 0).all()
    assert (np.diff(rates[peak:]) < 0).all()
    assert max(rates) <= 0.01
