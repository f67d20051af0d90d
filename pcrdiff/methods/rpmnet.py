"""RPM-Net (Yew & Lee 2020): soft matches of learned features, a pose, and again."""

from collections.abc import Mapping

import torch
from jaxtyping import Float
from torch import Tensor
from torch.nn.functional import normalize

from pcrdiff.models.losses import matching_losses
from pcrdiff.models.matching import AnnealingNet, match_scores, sinkhorn
from pcrdiff.models.refinement import SINKHORN_ITERATIONS, Steps, refine
from pcrdiff.models.structure import (
    PAIR_DIM,
    StructureEmbedding,
    describe_pairs,
    move,
    split_normals,
)
from pcrdiff.registration import LearnedMethod, Normals, Pairs, check_clouds


class RPMNet(LearnedMethod):
    """Point pair features to soft matches to a pose, which aligns the features of the next."""

    name = "rpmnet"

    def __init__(
        self,
        feature_dim: int,
        neighbours: int,
        radius: float,
        train_updates: int,
        updates: int,
        normals: Normals,
    ) -> None:
        """``feature_dim`` of a point, 96 by the authors; ``radius`` in the clouds' own unit.

        The pose is updated ``train_updates`` times in training and ``updates`` times afterwards.
        """
        super().__init__()
        self.embedding = StructureEmbedding(dim=feature_dim, ins=PAIR_DIM)
        self.annealing = AnnealingNet()
        self.neighbours, self.radius, self.normals = neighbours, radius, normals
        self.train_updates, self.updates = train_updates, updates

    def describe(self, cloud: Float[Tensor, "batch n channels"]) -> Float[Tensor, "batch n k 10"]:
        """Each point's neighbourhood, once per cloud: a motion is :func:`move`."""
        points, normals = split_normals(self.name, cloud, self.normals)
        return describe_pairs(points, normals, self.radius, self.neighbours)

    def features(self, descriptors: Float[Tensor, "batch n k 10"]) -> Float[Tensor, "batch n dim"]:
        """A unit feature of each point."""
        return normalize(self.embedding(descriptors), dim=-1)

    def align(
        self,
        source: Float[Tensor, "batch n channels"],
        target: Float[Tensor, "batch m channels"],
        updates: int,
    ) -> Steps:
        """T_target_source and the matches after each update (Sec. 4)."""
        source_descriptors = self.describe(source)
        target_features = self.features(self.describe(target))

        def match(
            T: Float[Tensor, "batch 4 4"],
            moved: Float[Tensor, "batch n 3"],
            fixed: Float[Tensor, "batch m 3"],
        ) -> Float[Tensor, "batch n m"]:
            alpha, beta = self.annealing(moved, fixed)
            source_features = self.features(move(source_descriptors, T))
            scores = match_scores(source_features, target_features, alpha, beta)
            return sinkhorn(scores, SINKHORN_ITERATIONS)

        return refine(source[..., :3], target[..., :3], match, updates)

    def loss(self, pairs: Pairs, *, generator: torch.Generator) -> Mapping[str, Float[Tensor, ""]]:
        """Distance to the true pose and share of unmatched points, of each update (Sec. 4.4)."""
        del generator
        source, target = pairs.clouds(self.normals)
        steps = self.align(source, target, self.train_updates)
        return matching_losses(steps, pairs.T_target_source.to(source), pairs.source)

    @torch.no_grad()
    def register(
        self,
        source: Float[Tensor, "batch n channels"],
        target: Float[Tensor, "batch m channels"],
        *,
        generator: torch.Generator,
    ) -> Float[Tensor, "batch 4 4"]:
        """The pose after the last update; clouds bring their normals where these are given."""
        del generator
        check_clouds(self.name, source, target, minimum=self.neighbours)
        return self.align(source, target, self.updates)[-1][0]
