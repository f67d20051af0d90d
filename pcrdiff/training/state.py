"""The state of a training between two epochs, and the checkpoint that keeps it."""

import math
from collections.abc import Mapping
from dataclasses import asdict
from typing import Protocol, runtime_checkable

from torch import Tensor
from torch.optim import Optimizer

from pcrdiff.registration import LearnedMethod
from pcrdiff.training.budget import Epoch


@runtime_checkable
class Checkpoint(Protocol):
    """Where a killed training is picked up again."""

    def load(self) -> tuple[dict[str, Tensor], dict[str, object]] | None:
        """What was saved last, or nothing."""
        ...

    def due(self) -> bool:
        """Whether it is time to save again; independent of what is saved."""
        ...

    def save(self, tensors: Mapping[str, Tensor], record: Mapping[str, object]) -> None:
        """Replace what was saved before, or keep that if the write fails."""
        ...


class State:
    """Everything that the next epoch depends on: weights, optimizer, curve and the best weights."""

    def __init__(self, method: LearnedMethod, optimizer: Optimizer) -> None:
        self.method, self.optimizer = method, optimizer
        self.curve: list[Epoch] = []
        self.best: dict[str, Tensor] = {}
        self.best_error, self.best_epoch = math.inf, -1

    def close(self, epoch: Epoch) -> None:
        """Append an epoch to the curve, and keep the weights if their validation is the best."""
        self.curve.append(epoch)
        if epoch.val_error_r_deg is not None and epoch.val_error_r_deg < self.best_error:
            self.best_error, self.best_epoch = epoch.val_error_r_deg, epoch.epoch
            weights = self.method.state_dict()
            self.best = {name: value.detach().clone() for name, value in weights.items()}

    def pack(self) -> tuple[dict[str, Tensor], dict[str, object]]:
        """The state as named tensors, and as a record that JSON can hold."""
        tensors = {f"model.{name}": value for name, value in self.method.state_dict().items()}
        tensors |= {f"best.{name}": value for name, value in self.best.items()}
        for index, moments in self.optimizer.state_dict()["state"].items():
            tensors |= {f"adam.{index}.{name}": value for name, value in moments.items()}
        curve = [asdict(epoch) for epoch in self.curve]
        return tensors, {"curve": curve, "best": self.best_error, "best_epoch": self.best_epoch}

    def unpack(self, tensors: Mapping[str, Tensor], record: Mapping[str, object]) -> None:
        """Take over what :meth:`pack` returned."""
        split: dict[str, dict[str, Tensor]] = {"model": {}, "best": {}, "adam": {}}
        for name, value in tensors.items():
            kind, _, rest = name.partition(".")
            split[kind][rest] = value
        self.method.load_state_dict(split["model"])
        self.best = split["best"]
        optimizer = self.optimizer.state_dict()
        for name, value in split["adam"].items():
            index, _, moment = name.partition(".")
            optimizer["state"].setdefault(int(index), {})[moment] = value
        self.optimizer.load_state_dict(optimizer)
        self.curve = [Epoch(**row) for row in record["curve"]]  # type: ignore[attr-defined]
        self.best_error = float(record["best"])  # type: ignore[arg-type]
        self.best_epoch = int(record["best_epoch"])  # type: ignore[call-overload]
