"""PCRDiffusion as plain PyTorch has it: the reference that the training step is measured against.

The same functions of the same weights, written as one would first write them: every point
differentiated, distances by ``cdist``, matches in the logarithm. Parts without a faster way (the
pose encoder, the heads, the pose space) are this project's own, copied.
"""

from collections.abc import Mapping
from copy import deepcopy

import torch
from jaxtyping import Float
from torch import Tensor, nn
from torch.nn.functional import normalize, pad

from pcrdiff.diffusion.process import corrupt
from pcrdiff.geometry.procrustes import fit_rigid
from pcrdiff.geometry.rigid import transform
from pcrdiff.methods.pcrdiffusion_cb import LEAST_ALPHA, PCRDiffusionCB
from pcrdiff.methods.pcrdiffusion_cf import PCRDiffusionCF
from pcrdiff.models.attention import CrossCloudAttention
from pcrdiff.models.losses import diffusion_loss, matching_losses, pose_loss
from pcrdiff.models.pose_encoder import fuse
from pcrdiff.registration import Pairs

Losses = Mapping[str, Float[Tensor, ""]]


class PlainPointNet(nn.Module):
    """The MLP on all points, then the maximum."""

    def __init__(self, encoder: nn.Module) -> None:
        """As wide as ``encoder``."""
        super().__init__()
        parts: list[nn.Module] = []
        for layer in encoder.modules():
            if isinstance(layer, nn.Linear):
                parts += [nn.Linear(layer.in_features, layer.out_features), nn.ReLU()]
        self.layers = nn.Sequential(*parts)

    def forward(self, points: Float[Tensor, "batch n ins"]) -> Float[Tensor, "batch dim"]:
        """The cloud's global feature."""
        features: Tensor = self.layers(points)
        return features.max(dim=1).values


class PlainCF(nn.Module):
    """PCRDiffusion CF with the weights of ``method``."""

    def __init__(self, method: PCRDiffusionCF) -> None:
        super().__init__()
        self.space = deepcopy(method.space)
        self.encoder = PlainPointNet(method.encoder)
        self.pose_encoder, self.head = deepcopy(method.pose_encoder), deepcopy(method.head)
        self.alphas_bar, self.fusion = method.alphas_bar, method.fusion
        load_in_order(self, method)

    def loss(self, pairs: Pairs, *, generator: torch.Generator) -> Losses:
        """Eqs. (15)-(17)."""
        source, target = pairs.source, pairs.target
        x_0 = self.space.encode(pairs.T_target_source).to(source)
        x_t, t = corrupt(x_0, self.alphas_bar, generator=generator)
        encoded = self.encoder(source), self.encoder(target)
        fused = fuse(self.fusion, self.pose_encoder(x_t, t), *encoded)
        prediction = self.space.step(self.head(fused))
        T_estimate = self.space.decode(prediction)
        return {
            "diffusion": diffusion_loss(prediction, x_0),
            "chamfer": plain_chamfer(transform(T_estimate, source), target),
            "pose": pose_loss(T_estimate, pairs.T_target_source.to(source)),
        }


def plain_chamfer(
    moved: Float[Tensor, "batch n 3"], target: Float[Tensor, "batch m 3"]
) -> Float[Tensor, ""]:
    """Eq. (16) over the whole matrix of distances."""
    squares = torch.cdist(moved, target).square()
    return squares.min(dim=2).values.mean() + squares.min(dim=1).values.mean()


class PlainEmbedding(nn.Module):
    """An MLP per neighbour, the maximum, an MLP per point (EGST)."""

    def __init__(self, ins: int, dim: int) -> None:
        super().__init__()
        self.per_neighbour = nn.Sequential(
            nn.Linear(ins, dim), nn.ReLU(), nn.Linear(dim, dim), nn.ReLU(),
            nn.Linear(dim, 2 * dim), nn.ReLU(),
        )  # fmt: skip
        self.per_point = nn.Sequential(
            nn.Linear(2 * dim, 2 * dim), nn.LayerNorm(2 * dim), nn.ReLU(),
            nn.Linear(2 * dim, dim), nn.LayerNorm(dim), nn.ReLU(),
            nn.Linear(dim, dim),
        )  # fmt: skip

    def forward(self, descriptors: Float[Tensor, "batch n k ins"]) -> Float[Tensor, "batch n dim"]:
        """The structured feature of each point."""
        pooled: Tensor = self.per_point(self.per_neighbour(descriptors).max(dim=2).values)
        return pooled


class PlainAttention(CrossCloudAttention):
    """EGST's layer with the scores written out."""

    def forward(
        self, features: Float[Tensor, "batch n dim"], other: Float[Tensor, "batch m dim"]
    ) -> Float[Tensor, "batch n dim"]:
        """Unit features of the first cloud that know of the second."""
        query = self._split(self.query(features))
        keys = self._split(torch.cat([self.own(features), self.other(other)], dim=1))
        scores = (query @ keys.mT) / query.shape[-1] ** 0.5
        attended = (scores.softmax(dim=-1) @ keys).transpose(1, 2).flatten(2)
        mixed = self.norm_attention(features + self.out(attended))
        return normalize(self.norm_feed(mixed + self.feed(mixed)), dim=-1)


class PlainCB(nn.Module):
    """PCRDiffusion CB with the weights of ``method``."""

    def __init__(self, method: PCRDiffusionCB) -> None:
        super().__init__()
        dim = method.attention.out.out_features
        self.space = deepcopy(method.space)
        self.embedding = PlainEmbedding(11, dim)
        self.pose_encoder = deepcopy(method.pose_encoder)
        self.attention = PlainAttention(dim, method.attention.heads)
        self.annealing = deepcopy(method.annealing)
        self.annealing.encoder = PlainPointNet(method.annealing.encoder)  # type: ignore[assignment]
        self.radius, self.neighbours = method.radius, method.neighbours
        self.alphas_bar, self.iterations = method.alphas_bar, method.sinkhorn_iterations
        load_in_order(self, method)

    def loss(self, pairs: Pairs, *, generator: torch.Generator) -> Losses:
        """Eq. (15) and RPM-Net's losses."""
        source, target = pairs.source, pairs.target
        T_truth = pairs.T_target_source.to(source)
        x_0 = self.space.encode(pairs.T_target_source).to(source)
        x_t, t = corrupt(x_0, self.alphas_bar, generator=generator)
        p, q = (
            self.embedding(plain_descriptors(cloud, self.radius, self.neighbours))
            for cloud in (source, target)
        )
        p = p + self.pose_encoder(x_t, t).unsqueeze(1)
        alpha, beta = (each[:, None, None] for each in self.annealing(source, target))
        squares = torch.cdist(self.attention(p, q), self.attention(q, p)).square()
        matches = plain_sinkhorn(-beta * (squares - alpha - LEAST_ALPHA), self.iterations)
        weights = matches.sum(dim=-1)
        matched = (matches @ target) / (weights.unsqueeze(-1) + 1e-5)
        T_estimate = fit_rigid(source, matched, weights + 1e-8)
        return {
            "diffusion": diffusion_loss(self.space.encode(T_estimate), x_0),
            **matching_losses([(T_estimate, matches)], T_truth, source),
        }


def plain_sinkhorn(
    scores: Float[Tensor, "batch n m"], iterations: int
) -> Float[Tensor, "batch n m"]:
    """Rows and columns normalised in turn, with a slack row and column (Yew & Lee 2020)."""
    log = pad(scores, (0, 1, 0, 1))
    for _ in range(iterations):
        rows = log[:, :-1] - log[:, :-1].logsumexp(dim=2, keepdim=True)
        log = torch.cat([rows, log[:, -1:]], dim=1)
        columns = log[:, :, :-1] - log[:, :, :-1].logsumexp(dim=1, keepdim=True)
        log = torch.cat([columns, log[:, :, -1:]], dim=2)
    return log[:, :-1, :-1].exp()


@torch.no_grad()
def plain_descriptors(
    points: Float[Tensor, "batch n 3"], radius: float, k: int
) -> Float[Tensor, "batch n k 11"]:
    """EGST's three descriptors of every point and neighbour, as :func:`describe` has them."""
    items = torch.arange(len(points))[:, None, None]
    distances, index = torch.cdist(points, points).topk(k, dim=-1, largest=False)
    normals = plain_normals(points, points[items, index])
    own = torch.arange(points.shape[1])[None, :, None]
    index = torch.where(distances <= radius, index, own)
    centred = points - points.mean(dim=1, keepdim=True)
    offset = points[items, index] - points.unsqueeze(2)
    n_centre, n_neighbour = normals.unsqueeze(2).expand_as(offset), normals[items, index]
    pairs = ((n_centre, offset), (n_neighbour, offset), (n_centre, n_neighbour))
    return torch.cat(
        [
            centred.unsqueeze(2).expand_as(offset),
            offset,
            *(plain_angle(a, b).unsqueeze(-1) for a, b in pairs),
            offset.norm(dim=-1, keepdim=True),
            plain_widest_angle(points, offset).unsqueeze(-1),
        ],
        dim=-1,
    )


def plain_angle(
    a: Float[Tensor, "*batch 3"], b: Float[Tensor, "*batch 3"]
) -> Float[Tensor, "*batch"]:
    """Angle in [0, pi]."""
    return torch.atan2(torch.linalg.cross(a, b).norm(dim=-1), (a * b).sum(dim=-1))


def plain_normals(
    points: Float[Tensor, "batch n 3"], patches: Float[Tensor, "batch n k 3"]
) -> Float[Tensor, "batch n 3"]:
    """The normal of the plane through each patch, away from the centroid."""
    spread = patches - patches.mean(dim=2, keepdim=True)
    normals = torch.linalg.eigh(spread.mT @ spread).eigenvectors[..., 0]
    outward = points - points.mean(dim=1, keepdim=True)
    return torch.where((normals * outward).sum(dim=-1, keepdim=True) >= 0, normals, -normals)


def plain_widest_angle(
    points: Float[Tensor, "batch n 3"], offset: Float[Tensor, "batch n k 3"]
) -> Float[Tensor, "batch n k"]:
    """Largest angle of a neighbour and any point, over all triplets at once.

    At a centre the centre itself is left out: one of its neighbours stands in its place.
    """
    near = normalize(offset, dim=-1)
    far = normalize(points.unsqueeze(1) - points.unsqueeze(2), dim=-1)
    first = near.norm(dim=-1).argmax(dim=-1)[..., None, None]
    stand_in = near.take_along_dim(first, dim=2).squeeze(2)
    far.diagonal(0, 1, 2).copy_(stand_in.mT)
    return torch.arccos((near @ far.mT).amin(dim=-1).clamp(-1, 1))


def load_in_order(plain: nn.Module, method: nn.Module) -> None:
    """Give ``plain`` the tensors of ``method`` and their dtype: both keep them in the same order."""
    plain.to(next(method.parameters()))
    tensors = method.state_dict().values()
    plain.load_state_dict(dict(zip(plain.state_dict(), tensors, strict=True)))
