"""PCRDiffusion, correspondence-free: the paper's Fig. 2 and Algorithms 1-2."""

from collections.abc import Mapping

import torch
from jaxtyping import Float, Int
from torch import Tensor

from pcrdiff.diffusion.process import corrupt
from pcrdiff.diffusion.sampling import Walk, sample
from pcrdiff.diffusion.schedule import cosine_alphas_bar
from pcrdiff.geometry.rigid import from_pose_vector, pose_vector, transform
from pcrdiff.losses import chamfer_loss, diffusion_loss, pose_loss
from pcrdiff.models.pointnet import PointNet
from pcrdiff.models.pose_encoder import PoseEncoder
from pcrdiff.models.pose_head import PoseHead
from pcrdiff.registration import LearnedMethod, Pairs, check_clouds


class PCRDiffusionCF(LearnedMethod):
    """Global features of both clouds and a noisy pose, to the clean pose."""

    name = "pcrdiffusion_cf"

    def __init__(self, walk: Walk, feature_dim: int) -> None:
        """``feature_dim`` of a cloud, 1024 in the paper."""
        super().__init__()
        self.encoder = PointNet((64, 64, 64, 128, feature_dim))
        self.pose_encoder = PoseEncoder(pose_dim=7, dim=feature_dim)
        self.head = PoseHead(dim=2 * feature_dim, widths=(1024, 1024, 512, 512, 256))
        self.walk, self.alphas_bar = walk, cosine_alphas_bar(walk.timesteps)

    def decode(
        self,
        x_t: Float[Tensor, "batch 7"],
        t: Int[Tensor, " batch"],
        source_features: Float[Tensor, "batch dim"],
        target_features: Float[Tensor, "batch dim"],
    ) -> Float[Tensor, "batch 7"]:
        """f_theta: predict G_0 from G_t, with F_t fused into the source's feature."""
        pose_features = self.pose_encoder(x_t, t)
        vector: Tensor = self.head(source_features + pose_features, target_features)
        return vector

    def loss(self, pairs: Pairs, *, generator: torch.Generator) -> Mapping[str, Float[Tensor, ""]]:
        """Eqs. (15)-(17) at one random time per pair (Algorithm 1)."""
        source, target = pairs.source, pairs.target
        x_0 = pose_vector(pairs.T_target_source).to(source)
        x_t, t = corrupt(x_0, self.alphas_bar, generator=generator)
        prediction = self.decode(x_t, t, self.encoder(source), self.encoder(target))
        T_estimate = from_pose_vector(prediction)
        return {
            "diffusion": diffusion_loss(prediction, x_0),
            "chamfer": chamfer_loss(transform(T_estimate, source), target),
            "pose": pose_loss(T_estimate, pairs.T_target_source.to(source)),
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
        check_clouds(self.name, source, target)
        source_features, target_features = self.encoder(source), self.encoder(target)
        vector = sample(
            lambda x_t, t: self.decode(x_t.to(source), t, source_features, target_features),
            len(source),
            7,
            self.walk,
            generator=generator,
        )
        return from_pose_vector(vector)
