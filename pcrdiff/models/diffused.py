"""Methods that diffuse the pose: what they share, apart from their networks."""

from abc import abstractmethod
from collections.abc import Sequence
from typing import Generic, TypeVar

import torch
from jaxtyping import Float
from torch import Tensor

from pcrdiff.diffusion.process import Times, Vectors, corrupt
from pcrdiff.diffusion.sampling import Walk, sample
from pcrdiff.diffusion.schedule import cosine_alphas_bar
from pcrdiff.geometry.neighbors import nearest
from pcrdiff.geometry.representation import RepresentationName
from pcrdiff.geometry.rigid import transform
from pcrdiff.models.pose_space import PoseSpace, Scaling
from pcrdiff.registration import LearnedMethod, Pairs, Poses, Sources, Targets

TRUSTED = 0.5  # share of the points, the closest ones, that a fit is judged by
Encoded = TypeVar("Encoded")


class DiffusedMethod(LearnedMethod, Generic[Encoded]):
    """A network that predicts the clean pose G_0 from a noisy one, and the walk through it."""

    def __init__(self, walk: Walk, representation: RepresentationName, scaling: Scaling) -> None:
        """``register`` follows ``walk``; the others define what is diffused."""
        super().__init__()
        self.space = PoseSpace(representation, scaling)
        self.walk, self.alphas_bar = walk, cosine_alphas_bar(walk.timesteps)

    def prepare(self, pairs: Pairs) -> None:
        """Take the scale of the pose vectors from the training poses."""
        self.space.fit(pairs.T_target_source)

    @abstractmethod
    def encode(self, source: Sources, target: Targets) -> Encoded:
        """What the network reads from the clouds alone, for every step of every walk."""

    @abstractmethod
    def denoise(self, x_t: Vectors, t: Times, encoded: Encoded) -> Vectors:
        """f_theta: predict G_0 from G_t."""

    def corrupt(
        self, pairs: Pairs, *, generator: torch.Generator
    ) -> tuple[Vectors, Vectors, Times]:
        """The true pose G_0 of each pair, a noisy G_t, and its time (Algorithm 1)."""
        x_0 = self.space.encode(pairs.T_target_source).to(pairs.source)
        return x_0, *corrupt(x_0, self.alphas_bar, generator=generator)

    def answer(self, source: Sources, target: Targets, *, generator: torch.Generator) -> Poses:
        """Encode both clouds once, then walk the pose back from noise (Algorithm 2)."""
        encoded = self.encode(source, target)
        return self.walk_back(encoded, source, target, self.walk, generator=generator)

    def decode(self, x_0: Vectors, encoded: Encoded) -> Poses:
        """The T_target_source of a vector, for the clouds that were encoded."""
        del encoded
        return self.space.decode(x_0)

    def propose(
        self, encoded: Encoded, like: Sources, walk: Walk, *, generator: torch.Generator
    ) -> Float[Tensor, "hypotheses batch 4 4"]:
        """The end of every walk; ``like`` is either cloud."""

        def denoise(x_t: Vectors, t: Times) -> Vectors:
            return self.denoise(x_t.to(like), t, encoded)

        found = sample(denoise, len(like), self.space.dim, walk, generator=generator)
        return torch.stack([self.decode(x_0, encoded) for x_0 in found])

    def walk_back(
        self,
        encoded: Encoded,
        source: Sources,
        target: Targets,
        walk: Walk,
        *,
        generator: torch.Generator,
    ) -> Poses:
        """Walk from noise to a pose; of several walks, keep the one that fits best.

        The choice does not use the true pose: see :func:`misfit`.
        """
        found = self.propose(encoded, source, walk, generator=generator)
        return best_fit(list(found), source, target)


def best_fit(poses: Sequence[Poses], source: Sources, target: Targets) -> Poses:
    """Of several answers to each pair the one with the least misfit; the first of equals."""
    if len(poses) == 1:
        return poses[0]
    misfits = torch.stack([misfit(transform(T, source), target) for T in poses])
    return torch.stack(list(poses))[misfits.argmin(dim=0), torch.arange(len(source))]


def misfit(moved: Sources, target: Targets) -> Float[Tensor, " batch"]:
    """Mean distance to the nearest point of the other cloud, over the closest half of both.

    The further half is left out: it may be what the other cloud does not show.
    """
    ways = ((moved, target), (target, moved))
    squares = torch.cat([nearest(queries, points, 1)[0][..., 0] for queries, points in ways], dim=1)
    trusted = max(1, int(TRUSTED * squares.shape[1]))
    return squares.topk(trusted, dim=1, largest=False).values.sqrt().mean(dim=1)
