"""PCRDiffusion, correspondence-based: the paper's Fig. 3, EGST's decoder told a noisy pose.

Memory. What a training step keeps for its backward pass, in bytes of float32, is::

    4 batch (N M + (N + M) (11 k + 22 dim + 24))

and what ``AnnealingNet`` keeps: Sinkhorn's kernel, the descriptors of k neighbours a point, and the
layers that act on points. Layers that act on edges keep nothing (``pcrdiff.models.edge_mlp``), nor
do Sinkhorn's iterations. A registration keeps no N x M: it grows with N + M.
"""

from collections.abc import Mapping
from dataclasses import replace
from functools import partial

import torch
from jaxtyping import Float, Int
from torch import Tensor

from pcrdiff.diffusion.process import corrupt
from pcrdiff.diffusion.sampling import Walk
from pcrdiff.diffusion.schedule import cosine_alphas_bar
from pcrdiff.geometry.representation import RepresentationName
from pcrdiff.models.attention import CrossCloudAttention
from pcrdiff.models.denoising import walk_back
from pcrdiff.models.losses import diffusion_loss, matching_losses
from pcrdiff.models.matching import AnnealingNet, Matchable, fit_matches
from pcrdiff.models.pose_encoder import Diffusion, make_pose_encoder
from pcrdiff.models.pose_space import PoseSpace, Scaling
from pcrdiff.models.structure import StructureEmbedding, describe
from pcrdiff.registration import LearnedMethod, Pairs, check_clouds


class PCRDiffusionCB(LearnedMethod):
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
        super().__init__()
        self.space = PoseSpace(representation, scaling)
        self.embedding = StructureEmbedding(dim=feature_dim)
        self.pose_encoder = make_pose_encoder(diffusion, self.space.dim, feature_dim)
        self.attention = CrossCloudAttention(dim=feature_dim)
        self.annealing = AnnealingNet()
        self.walk, self.alphas_bar = walk, cosine_alphas_bar(walk.timesteps)
        self.neighbours, self.radius = neighbours, radius
        self.sinkhorn_iterations = sinkhorn_iterations

    def prepare(self, pairs: Pairs) -> None:
        """Take the scale of the pose vectors from the training poses."""
        self.space.fit(pairs.T_target_source)

    def encode(
        self, source: Float[Tensor, "batch n 3"], target: Float[Tensor, "batch m 3"]
    ) -> Matchable:
        """Describe and embed both clouds, and read off the annealing; used at every step."""
        source_features, target_features = (
            self.embedding(describe(cloud, self.radius, self.neighbours))
            for cloud in (source, target)
        )
        alpha, beta = self.annealing(source, target)
        return Matchable(source, target, source_features, target_features, alpha, beta)

    def tell(
        self, x_t: Float[Tensor, "batch entries"], t: Int[Tensor, " batch"], encoded: Matchable
    ) -> Matchable:
        """The clouds' features once both clouds have heard of each other and of a noisy pose.

        F_t joins the source's features before the transformer: after it, an offset that all
        points of a cloud share would cancel in Sinkhorn's rows (reports/DEVIATIONS.md).
        """
        pose_features = self.pose_encoder(x_t, t).unsqueeze(1)
        source_features = encoded.source_features + pose_features
        target_features = encoded.target_features
        return replace(
            encoded,
            source_features=self.attention(source_features, target_features),
            target_features=self.attention(target_features, source_features),
        )

    def match(
        self, x_t: Float[Tensor, "batch entries"], t: Int[Tensor, " batch"], encoded: Matchable
    ) -> Float[Tensor, "batch n m"]:
        """Soft matches given a noisy pose."""
        return self.tell(x_t, t, encoded).matches(self.sinkhorn_iterations)

    def loss(self, pairs: Pairs, *, generator: torch.Generator) -> Mapping[str, Float[Tensor, ""]]:
        """Eq. (15), and RPM-Net's losses where the paper says "identical to EGST's"."""
        source, T_truth = pairs.source, pairs.T_target_source.to(pairs.source)
        x_0 = self.space.encode(pairs.T_target_source).to(source)
        x_t, t = corrupt(x_0, self.alphas_bar, generator=generator)
        encoded = self.encode(source, pairs.target)
        matches = self.match(x_t, t, encoded)
        T_estimate = fit_matches(source, pairs.target, matches)
        return {
            "diffusion": diffusion_loss(self.space.encode(T_estimate), x_0),
            **matching_losses([(T_estimate, matches)], T_truth, source),
        }

    @torch.no_grad()
    def register(
        self,
        source: Float[Tensor, "batch n 3"],
        target: Float[Tensor, "batch m 3"],
        *,
        generator: torch.Generator,
    ) -> Float[Tensor, "batch 4 4"]:
        """Encode both clouds once, then walk the pose back from noise (Algorithm 2)."""
        check_clouds(self.name, source, target, minimum=self.neighbours)
        denoise = partial(self.denoise, encoded=self.encode(source, target))
        return walk_back(denoise, source, target, self.space, self.walk, generator=generator)

    def denoise(
        self, x_t: Float[Tensor, "batch entries"], t: Int[Tensor, " batch"], encoded: Matchable
    ) -> Float[Tensor, "batch entries"]:
        """f_theta: predict G_0 from G_t, by the pose that fits the matches (Eq. 1)."""
        return self.space.encode(self.tell(x_t, t, encoded).fit(self.sinkhorn_iterations))
