"""The errors of a method in training on the validation pairs, which choose its weights."""

import torch
from jaxtyping import Float, Float64
from torch import Tensor

from pcrdiff.geometry.metrics import error_r_deg, error_t
from pcrdiff.registration import LearnedMethod, Pairs
from pcrdiff.training.ranks import Processes


class Validation:
    """The validation pairs, registered with the same noise every time.

    One generator serves all pairs, one after the other. The first time each process registers all
    of them and keeps the state of the generator at its own; from then on they share the pairs.
    """

    def __init__(self, pairs: Pairs, *, seed: int, processes: Processes) -> None:
        self.pairs, self.seed, self.processes = pairs, seed, processes
        self.noise: dict[int, Tensor] | None = None

    def errors(self, method: LearnedMethod) -> tuple[float, float]:
        """Mean ERROR(R) in degrees and ERROR(t) over the pairs; the method is left in training."""
        method.eval()
        estimate, truth = self._estimates(method), self.pairs.T_target_source
        method.train()
        return error_r_deg(estimate, truth).mean().item(), error_t(estimate, truth).mean().item()

    def _estimates(self, method: LearnedMethod) -> Float64[Tensor, "pairs 4 4"]:
        """The pose of each validation pair."""
        generator = torch.Generator().manual_seed(self.seed)
        source, target = self.pairs.clouds(method.normals)

        def register(i: int) -> Float[Tensor, "4 4"]:
            clouds = (cloud[i : i + 1].to(self.processes.device) for cloud in (source, target))
            return method.register(*clouds, generator=generator)[0]

        poses = torch.zeros(len(self.pairs), 4, 4, dtype=torch.float64)
        if self.noise is not None:
            for i, state in self.noise.items():
                generator.set_state(state)
                poses[i] = register(i)
            return self.processes.total(poses)
        states = []
        for i in range(len(self.pairs)):
            states.append(generator.get_state())
            poses[i] = register(i)
        rank, count = self.processes.rank, self.processes.count
        if count > 1:
            self.noise = {i: states[i] for i in range(rank, len(self.pairs), count)}
        return poses
