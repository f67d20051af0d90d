"""PCRDiffusion, correspondence-free: the paper's Fig. 2 and Algorithms 1-2."""

from collections.abc import Mapping
from functools import partial

import torch
from jaxtyping import Float, Int
from torch import Tensor

from pcrdiff.diffusion.process import corrupt
from pcrdiff.diffusion.sampling import Walk
from pcrdiff.diffusion.schedule import cosine_alphas_bar
from pcrdiff.geometry.representation import RepresentationName
from pcrdiff.geometry.rigid import transform
from pcrdiff.models.denoising import walk_back
from pcrdiff.models.fusion import FEATURES, Fusion, fuse
from pcrdiff.models.losses import chamfer_loss, diffusion_loss, pose_loss
from pcrdiff.models.pointnet import PointNet
from pcrdiff.models.pose_encoder import Diffusion, make_pose_encoder
from pcrdiff.models.pose_head import PoseHead
from pcrdiff.models.pose_space import PoseSpace, Scaling
from pcrdiff.registration import LearnedMethod, Pairs, check_clouds

Encoded = tuple[Float[Tensor, "batch dim"], Float[Tensor, "batch dim"]]
"""F_P and F_Q: a pair of clouds, encoded once and used at every step."""


class PCRDiffusionCF(LearnedMethod):
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
        super().__init__()
        self.space = PoseSpace(representation, scaling)
        self.encoder = PointNet((64, 64, 64, 128, feature_dim))
        self.pose_encoder = make_pose_encoder(diffusion, self.space.dim, feature_dim)
        self.head = PoseHead(
            FEATURES[fusion] * feature_dim, (1024, 1024, 512, 512, 256), self.space.dim
        )
        self.walk, self.alphas_bar, self.fusion = walk, cosine_alphas_bar(walk.timesteps), fusion

    def prepare(self, pairs: Pairs) -> None:
        """Take the scale of the pose vectors from the training poses."""
        self.space.fit(pairs.T_target_source)

    def encode(
        self, source: Float[Tensor, "batch n 3"], target: Float[Tensor, "batch m 3"]
    ) -> Encoded:
        """The global feature of each cloud."""
        return self.encoder(source), self.encoder(target)

    def denoise(
        self, x_t: Float[Tensor, "batch entries"], t: Int[Tensor, " batch"], encoded: Encoded
    ) -> Float[Tensor, "batch entries"]:
        """f_theta: predict G_0 from G_t."""
        fused = fuse(self.fusion, self.pose_encoder(x_t, t), *encoded)
        return self.space.step(self.head(fused))

    def loss(self, pairs: Pairs, *, generator: torch.Generator) -> Mapping[str, Float[Tensor, ""]]:
        """Eqs. (15)-(17) at one random time per pair (Algorithm 1)."""
        source, target = pairs.source, pairs.target
        x_0 = self.space.encode(pairs.T_target_source).to(source)
        x_t, t = corrupt(x_0, self.alphas_bar, generator=generator)
        prediction = self.denoise(x_t, t, self.encode(source, target))
        T_estimate = self.space.decode(prediction)
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
        denoise = partial(self.denoise, encoded=self.encode(source, target))
        return walk_back(denoise, source, target, self.space, self.walk, generator=generator)
