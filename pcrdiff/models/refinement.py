"""RPM-Net's loop (Yew & Lee 2020): match, fit a pose, move the source by it, and again."""

from abc import abstractmethod
from collections.abc import Callable

import torch
from jaxtyping import Float
from torch import Tensor

from pcrdiff.geometry.rigid import from_parts, transform
from pcrdiff.models.losses import matching_losses
from pcrdiff.models.matching import AnnealingNet, Matchable, fit_matches
from pcrdiff.models.structure import StructureEmbedding, move
from pcrdiff.registration import LearnedMethod, Losses, Normals, Pairs, Poses, Sources, Targets

Points = Float[Tensor, "batch n 3"]
SINKHORN_ITERATIONS = 5  # RPM-Net's

Steps = list[tuple[Poses, Float[Tensor, "batch n m"]]]
"""The pose and the matches it was fitted to, of each update."""

Matcher = Callable[[Poses, Sources, Targets], Float[Tensor, "batch n m"]]
"""The pose so far, the source under it and the target, to matches; all from the target's mean."""

Features = tuple[Float[Tensor, "batch n dim"], Float[Tensor, "batch m dim"]]
"""Of every source point and of every target point."""


class RefinedMethod(LearnedMethod):
    """Described neighbourhoods to soft matches to a pose, which aligns the features of the next."""

    descriptor_dim: int
    """Entries of a neighbour's descriptor."""

    def __init__(
        self,
        feature_dim: int,
        neighbours: int,
        radius: float,
        train_updates: int,
        updates: int,
        normals: Normals,
    ) -> None:
        """``feature_dim`` of a point; ``radius`` of a neighbourhood, in the clouds' own unit.

        The pose is updated ``train_updates`` times in training and ``updates`` times afterwards.
        """
        super().__init__()
        self.embedding = StructureEmbedding(feature_dim, self.descriptor_dim)
        self.add_layers(feature_dim)
        self.annealing = AnnealingNet()
        self.neighbours, self.radius, self.normals = neighbours, radius, normals
        self.train_updates, self.updates, self.least_points = train_updates, updates, neighbours

    def add_layers(self, feature_dim: int) -> None:
        """Make the layers that :meth:`relate` needs, between the embedding and the annealing."""

    @abstractmethod
    def describe(self, points: Points, normals: Points | None) -> Float[Tensor, "batch n k dim"]:
        """Each point's neighbourhood, once per cloud: a motion is :func:`move`."""

    def embed(self, descriptors: Float[Tensor, "batch n k dim"]) -> Float[Tensor, "batch n d"]:
        """A feature of each point of one cloud."""
        features: Tensor = self.embedding(descriptors)
        return features

    def relate(
        self, source: Float[Tensor, "batch n dim"], target: Float[Tensor, "batch m dim"]
    ) -> Features:
        """The features that are matched, once both clouds' are known."""
        return source, target

    def align(self, source: Sources, target: Targets, updates: int) -> Steps:
        """T_target_source and the matches after each update (Yew & Lee 2020, Sec. 4).

        Raises:
            ValueError: A cloud comes without the normals, or with some that are not asked for.
        """
        p, p_normals = split_normals(self.name, source, self.normals)
        q, q_normals = split_normals(self.name, target, self.normals)
        source_descriptors = self.describe(p, p_normals)
        target_features = self.embed(self.describe(q, q_normals))

        def match(T: Poses, moved: Sources, fixed: Targets) -> Float[Tensor, "batch n m"]:
            annealed = self.annealing(moved, fixed)
            features = self.relate(self.embed(move(source_descriptors, T)), target_features)
            return Matchable(moved, fixed, *features, *annealed).matches(SINKHORN_ITERATIONS)

        return refine(p, q, match, updates)

    def loss(self, pairs: Pairs, *, generator: torch.Generator) -> Losses:
        """Distance to the true pose and share of unmatched points, of each update (Sec. 4.4)."""
        source, target = pairs.clouds(self.normals)
        steps = self.align(source, target, self.train_updates)
        return matching_losses(steps, pairs.T_target_source.to(source), pairs.source)

    def answer(self, source: Sources, target: Targets, *, generator: torch.Generator) -> Poses:
        """The pose after the last update; nothing is drawn."""
        return self.align(source, target, self.updates)[-1][0]


def split_normals(
    who: str, cloud: Float[Tensor, "batch n channels"], normals: Normals
) -> tuple[Points, Points | None]:
    """Points, and their unit normals where these are given.

    Raises:
        ValueError: The cloud comes without the normals, or with some that are not asked for.
    """
    wanted = 6 if normals == "given" else 3
    if cloud.shape[-1] != wanted:
        raise ValueError(
            f"{who} with {normals} normals needs {wanted} channels, got {cloud.shape[-1]}"
        )
    return cloud[..., :3], cloud[..., 3:] if normals == "given" else None


def refine(source: Sources, target: Targets, match: Matcher, updates: int) -> Steps:
    """T_target_source and the matches after each update.

    The first update sees the clouds with their means in one place. Each pose is fitted to the
    source as it was given, and passes no gradient to the next update.

    Raises:
        ValueError: ``updates`` is not at least 1.
    """
    if updates < 1:
        raise ValueError(f"refine needs at least 1 update, got {updates}")
    p_mean, q_mean = source.mean(dim=-2), target.mean(dim=-2)
    p, q = source - p_mean.unsqueeze(-2), target - q_mean.unsqueeze(-2)
    eye = torch.eye(3).to(source).expand(len(source), 3, 3)
    T, steps = from_parts(eye, torch.zeros_like(p_mean)), []
    for _ in range(updates):
        matches = match(T, transform(T, p), q)
        estimate = fit_matches(p, q, matches)
        steps.append((from_parts(eye, q_mean) @ estimate @ from_parts(eye, -p_mean), matches))
        T = estimate.detach()
    return steps
