"""EGST (Yuan et al. 2024): structured features and attention to soft matches to a pose, twice."""

from collections.abc import Mapping

import torch
from jaxtyping import Float
from torch import Tensor

from pcrdiff.models.attention import CrossCloudAttention
from pcrdiff.models.losses import matching_losses
from pcrdiff.models.matching import AnnealingNet, match_scores, sinkhorn
from pcrdiff.models.refinement import SINKHORN_ITERATIONS, Steps, refine
from pcrdiff.models.structure import (
    StructureEmbedding,
    describe,
    move,
    split_normals,
)
from pcrdiff.registration import LearnedMethod, Normals, Pairs, check_clouds


class EGST(LearnedMethod):
    """PCRDiffusion CB's decoder without the diffusion, as its authors published it."""

    name = "egst"

    def __init__(
        self,
        feature_dim: int,
        neighbours: int,
        radius: float,
        train_updates: int,
        updates: int,
        normals: Normals,
    ) -> None:
        """``feature_dim`` of a point, 128 by the authors; ``radius`` in the clouds' own unit.

        The pose is updated ``train_updates`` times in training and ``updates`` times afterwards.
        """
        super().__init__()
        self.embedding = StructureEmbedding(dim=feature_dim)
        self.attention = CrossCloudAttention(dim=feature_dim)
        self.annealing = AnnealingNet()
        self.neighbours, self.radius, self.normals = neighbours, radius, normals
        self.train_updates, self.updates = train_updates, updates

    def describe(self, cloud: Float[Tensor, "batch n channels"]) -> Float[Tensor, "batch n k 11"]:
        """The three descriptors of each neighbourhood, once per cloud: a motion is ``move``."""
        points, normals = split_normals(self.name, cloud, self.normals)
        return describe(points, self.radius, self.neighbours, normals)

    def align(
        self,
        source: Float[Tensor, "batch n channels"],
        target: Float[Tensor, "batch m channels"],
        updates: int,
    ) -> Steps:
        """T_target_source and the matches after each update."""
        source_descriptors = self.describe(source)
        target_features = self.embedding(self.describe(target))

        def match(
            T: Float[Tensor, "batch 4 4"],
            moved: Float[Tensor, "batch n 3"],
            fixed: Float[Tensor, "batch m 3"],
        ) -> Float[Tensor, "batch n m"]:
            alpha, beta = self.annealing(moved, fixed)
            source_features = self.embedding(move(source_descriptors, T))
            scores = match_scores(
                self.attention(source_features, target_features),
                self.attention(target_features, source_features),
                alpha,
                beta,
            )
            return sinkhorn(scores, SINKHORN_ITERATIONS)

        return refine(source[..., :3], target[..., :3], match, updates)

    def loss(self, pairs: Pairs, *, generator: torch.Generator) -> Mapping[str, Float[Tensor, ""]]:
        """RPM-Net's losses of each update; EGST's own are not public."""
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
