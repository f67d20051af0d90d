"""PCRDiffusion, correspondence-based: the paper's Fig. 3, EGST's decoder given a noisy pose.

Memory. What a training step keeps for its backward pass, in bytes of float32, is::

    4 batch (N M + (N + M) (11 k + 22 dim + 24))

and what ``AnnealingNet`` keeps: Sinkhorn's kernel, the descriptors of k neighbours per point, and
the layers that act on points. Layers that act on edges keep nothing (``pcrdiff.models.edge_mlp``),
nor do Sinkhorn's iterations. A registration keeps no N x M: it grows with N + M.
"""

from dataclasses import replace

import torch

from pcrdiff.diffusion.process import Times, Vectors
from pcrdiff.diffusion.sampling import Walk
from pcrdiff.geometry.representation import RepresentationName
from pcrdiff.models.attention import CrossCloudAttention
from pcrdiff.models.diffused import DiffusedMethod
from pcrdiff.models.losses import diffusion_loss, matching_losses
from pcrdiff.models.matching import AnnealingNet, Matchable, fit_matches
from pcrdiff.models.pose_encoder import Diffusion, make_pose_encoder
from pcrdiff.models.pose_space import Scaling
from pcrdiff.models.structure import DESCRIPTOR_DIM, StructureEmbedding, describe
from pcrdiff.registration import Losses, Pairs, Sources, Targets

LEAST_ALPHA = 1.0
"""Below it, training can end where no point matches anything and the features no longer learn."""


class PCRDiffusionCB(DiffusedMethod[Matchable]):
    """Structured features of every point and a noisy pose, to soft matches, to the clean pose."""

    name = "pcrdiffusion_cb"

    def __init__(  # noqa: PLR0913 - EGST's numbers, and what Tables 3 and 4 vary
        self,
        walk: Walk,
        feature_dim: int,
        neighbours: int,
        radius: float,
        sinkhorn_iterations: int,
        representation: RepresentationName,
        scaling: Scaling,
        diffusion: Diffusion,
    ) -> None:
        """``feature_dim`` of a point, 128 in EGST; ``radius`` in the clouds' own unit."""
        super().__init__(walk, representation, scaling)
        self.embedding = StructureEmbedding(feature_dim, DESCRIPTOR_DIM)
        self.pose_encoder = make_pose_encoder(diffusion, self.space.dim, feature_dim)
        self.attention = CrossCloudAttention(dim=feature_dim)
        self.annealing = AnnealingNet()
        self.neighbours, self.radius, self.least_points = neighbours, radius, neighbours
        self.sinkhorn_iterations = sinkhorn_iterations

    def encode(self, source: Sources, target: Targets) -> Matchable:
        """Describe and embed both clouds, and read the annealing from them."""
        source_features, target_features = (
            self.embedding(describe(cloud, None, self.radius, self.neighbours))
            for cloud in (source, target)
        )
        alpha, beta = self.annealing(source, target)
        return Matchable(
            source, target, source_features, target_features, alpha + LEAST_ALPHA, beta
        )

    def condition(self, x_t: Vectors, t: Times, encoded: Matchable) -> Matchable:
        """The features after cross-attention, conditioned on the noisy pose.

        F_t joins the source's features before the transformer: after it, an offset that all
        points of a cloud share would cancel in Sinkhorn's rows (reports/DEVIATIONS.md).
        """
        source_features = encoded.source_features + self.pose_encoder(x_t, t).unsqueeze(1)
        target_features = encoded.target_features
        return replace(
            encoded,
            source_features=self.attention(source_features, target_features),
            target_features=self.attention(target_features, source_features),
        )

    def denoise(self, x_t: Vectors, t: Times, encoded: Matchable) -> Vectors:
        """f_theta: predict G_0 from G_t, by the pose that fits the matches (Eq. 1)."""
        return self.space.encode(self.condition(x_t, t, encoded).fit(self.sinkhorn_iterations))

    def loss(self, pairs: Pairs, *, generator: torch.Generator) -> Losses:
        """Eq. (15), and RPM-Net's losses where the paper says "identical to EGST's"."""
        source, target = pairs.source, pairs.target
        x_0, x_t, t = self.corrupt(pairs, generator=generator)
        conditioned = self.condition(x_t, t, self.encode(source, target))
        matches = conditioned.matches(self.sinkhorn_iterations)
        T_estimate = fit_matches(source, target, matches)
        T_truth = pairs.T_target_source.to(source)
        return {
            "diffusion": diffusion_loss(self.space.encode(T_estimate), x_0),
            **matching_losses([(T_estimate, matches)], T_truth, source),
        }
