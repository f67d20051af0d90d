"""PCRDiffusion, correspondence-free: the paper's Fig. 2 and Algorithms 1-2."""

import torch
from jaxtyping import Float
from torch import Tensor

from pcrdiff.diffusion.process import Times, Vectors
from pcrdiff.diffusion.sampling import Walk
from pcrdiff.geometry.representation import RepresentationName
from pcrdiff.geometry.rigid import transform
from pcrdiff.models.diffused import DiffusedMethod
from pcrdiff.models.losses import chamfer_loss, diffusion_loss, pose_loss
from pcrdiff.models.mlp import PoseHead
from pcrdiff.models.pointnet import PointNet
from pcrdiff.models.pose_encoder import FEATURES, Diffusion, Fusion, fuse, make_pose_encoder
from pcrdiff.models.pose_space import Scaling
from pcrdiff.registration import Losses, Pairs, Sources, Targets

Encoded = tuple[Float[Tensor, "batch dim"], Float[Tensor, "batch dim"]]
"""F_P and F_Q."""


class PCRDiffusionCF(DiffusedMethod[Encoded]):
    """Global features of both clouds and a noisy pose, to the clean pose."""

    name = "pcrdiffusion_cf"

    def __init__(
        self,
        walk: Walk,
        feature_dim: int,
        representation: RepresentationName,
        scaling: Scaling,
        fusion: Fusion,
        diffusion: Diffusion,
    ) -> None:
        """``feature_dim`` of a cloud, 1024 in the paper; the rest is what Tables 3 to 5 vary."""
        super().__init__(walk, representation, scaling)
        self.encoder = PointNet((64, 64, 64, 128, feature_dim))
        self.pose_encoder = make_pose_encoder(diffusion, self.space.dim, feature_dim)
        self.head = PoseHead(
            FEATURES[fusion] * feature_dim, (1024, 1024, 512, 512, 256), self.space.dim
        )
        self.fusion = fusion

    def encode(self, source: Sources, target: Targets) -> Encoded:
        """The global feature of each cloud."""
        return self.encoder(source), self.encoder(target)

    def denoise(self, x_t: Vectors, t: Times, encoded: Encoded) -> Vectors:
        """f_theta: predict G_0 from G_t, as a step that the head takes."""
        fused = fuse(self.fusion, self.pose_encoder(x_t, t), *encoded)
        return self.space.step(self.head(fused))

    def loss(self, pairs: Pairs, *, generator: torch.Generator) -> Losses:
        """Eqs. (15)-(17) at one random time per pair (Algorithm 1)."""
        source, target = pairs.source, pairs.target
        x_0, x_t, t = self.corrupt(pairs, generator=generator)
        prediction = self.denoise(x_t, t, self.encode(source, target))
        T_estimate = self.space.decode(prediction)
        return {
            "diffusion": diffusion_loss(prediction, x_0),
            "chamfer": chamfer_loss(transform(T_estimate, source), target),
            "pose": pose_loss(T_estimate, pairs.T_target_source.to(source)),
        }
