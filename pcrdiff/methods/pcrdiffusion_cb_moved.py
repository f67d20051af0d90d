"""PCRDiffusion CB with a step that sees the pose: the source's description is moved by G_t.

Beyond the paper. There the network is told G_t as a vector, and trained to convergence it ignores
it: more steps change nothing. Here a step compares the target with the source as G_t lays it, so
that a second step sees what the first one left. Clouds are described once per pair.
"""

from dataclasses import dataclass

import torch
from jaxtyping import Float
from torch import Tensor, nn
from torch.nn.functional import normalize, softplus

from pcrdiff.diffusion.process import Times, Vectors, corrupt
from pcrdiff.diffusion.sampling import Walk
from pcrdiff.diffusion.shares import rows_drawn
from pcrdiff.geometry.rigid import from_parts, transform
from pcrdiff.models.attention import CrossCloudAttention
from pcrdiff.models.diffused import DiffusedMethod
from pcrdiff.models.losses import Counterparts, counterparts, inlier_loss, match_loss, point_loss
from pcrdiff.models.matching import Matchable, fit_matches
from pcrdiff.models.moving import MOVING, NEAR, Described, MovingEmbedding
from pcrdiff.models.pose_encoder import TIME_DIM, time_embedding
from pcrdiff.registration import Losses, Pairs, Poses, Sources, Targets

CERTAINTY = 3
"""The power of a match that is its weight in the pose: points that match many say little."""
CONTEXT = 8  # what attention says, next to what a point is by itself
SHARPNESS = 20  # of the matches, when training begins
NOISY, WALKED = 2, 2
"""Poses that a pair is trained on: corrupted true ones, and those of a walk on its own answers."""
MOST_POINTS = 512
"""That the network looks at: a patch is a number of neighbours, so its size depends on them."""
MATCH_WEIGHT, INLIER_WEIGHT = 0.05, 0.01


@dataclass(frozen=True)
class Encoded:
    """Both clouds about their centroids, described, and where the centroids are."""

    source: Described
    target: Described
    source_mean: Float[Tensor, "batch 3"]
    target_mean: Float[Tensor, "batch 3"]


class PCRDiffusionCBMoved(DiffusedMethod[Encoded]):
    """Described points under a noisy pose, to soft matches, to the clean pose about the centroids."""

    name = "pcrdiffusion_cb_moved"
    least_points = NEAR

    def __init__(
        self, walk: Walk, feature_dim: int, attention_layers: int, sinkhorn_iterations: int
    ) -> None:
        """``feature_dim`` of a point; attention relates the clouds once, before any step."""
        super().__init__(walk, "rotation_6d", "standardised")
        dim = feature_dim
        self.embedding, self.position = MovingEmbedding(dim), nn.Linear(MOVING, dim)
        self.attention = nn.ModuleList(
            CrossCloudAttention(dim, heads=1) for _ in range(attention_layers)
        )
        self.time = nn.Sequential(nn.Linear(TIME_DIM, dim), nn.SiLU(), nn.Linear(dim, 2 * dim))
        self.join = nn.Linear(dim + MOVING, 2 * dim)
        self.match = nn.Sequential(
            nn.LayerNorm(2 * dim),
            nn.ReLU(),
            nn.Linear(2 * dim, 2 * dim),
            nn.LayerNorm(2 * dim),
            nn.ReLU(),
            nn.Linear(2 * dim, dim),
        )
        self.annealing = nn.Sequential(nn.Linear(TIME_DIM, dim), nn.SiLU(), nn.Linear(dim, 2))
        self.sinkhorn_iterations = sinkhorn_iterations

    def prepare(self, pairs: Pairs) -> None:
        """Take the scale of the pose vectors from the training poses about the centroids."""
        p_mean, q_mean = pairs.source.double().mean(dim=1), pairs.target.double().mean(dim=1)
        self.space.fit(between_centroids(pairs.T_target_source, p_mean, q_mean))

    def encode(self, source: Sources, target: Targets) -> Encoded:
        """Describe both clouds, and let each look at the other as the mean pose lays them."""
        p_mean, q_mean = source.mean(dim=1), target.mean(dim=1)
        p, q = (
            self.embedding(thinned(cloud - mean.unsqueeze(1)))
            for cloud, mean in ((source, p_mean), (target, q_mean))
        )
        T_mean = self.space.decode(torch.zeros(len(source), self.space.dim).to(source))
        of_p = p.invariant + self.position(p.moved(T_mean))
        of_q = q.invariant + self.position(q.moved(torch.eye(4).to(T_mean).expand_as(T_mean)))
        for layer in self.attention:
            of_p, of_q = layer(of_p, of_q), layer(of_q, of_p)
        return Encoded(
            p.with_context(CONTEXT * of_p), q.with_context(CONTEXT * of_q), p_mean, q_mean
        )

    def decode(self, x_0: Vectors, encoded: Encoded) -> Poses:
        """The pose of the clouds where they lie."""
        return between_centroids(self.space.decode(x_0), -encoded.source_mean, -encoded.target_mean)

    def matchable(self, x_t: Vectors, t: Times, encoded: Encoded) -> Matchable:
        """Features of the source as G_t lays it and of the target; the sharpness is that of t."""
        when = time_embedding(t, TIME_DIM).to(encoded.source.points)
        T = self.space.decode(x_t)
        poses = (encoded.source, T), (encoded.target, torch.eye(4).to(T).expand_as(T))
        features = [
            self.match(
                self.join(torch.cat([cloud.invariant, cloud.moved(pose)], dim=-1))
                + self.time(when).unsqueeze(1)
            )
            for cloud, pose in poses
        ]
        alpha, beta = softplus(self.annealing(when)).unbind(-1)
        p, q = (normalize(feature, dim=-1) for feature in features)
        return Matchable(
            encoded.source.points, encoded.target.points, p, q, alpha, SHARPNESS * beta
        )

    def fit(self, matchable: Matchable) -> tuple[Poses, Float[Tensor, "batch n m"]]:
        """The pose that fits the matches, the certain ones before all, and the matches."""
        matches = matchable.matches(self.sinkhorn_iterations)
        largest = matches.detach().amax(dim=(1, 2), keepdim=True).clamp(min=1e-9)
        weights = (matches / largest) ** CERTAINTY
        return fit_matches(matchable.source, matchable.target, weights), matches

    def denoise(self, x_t: Vectors, t: Times, encoded: Encoded) -> Vectors:
        """f_theta: predict G_0 from the clouds as G_t lays them (Eq. 1)."""
        return self.space.encode(self.fit(self.matchable(x_t, t, encoded))[0])

    def loss(self, pairs: Pairs, *, generator: torch.Generator) -> Losses:
        """Where the points come to lie, and which of them match, under several poses of each pair.

        Half of the poses are true ones, corrupted (Algorithm 1). The others are those of a walk
        that begins in the mode or in noise and goes on from its own answers.
        """
        encoded = self.encode(pairs.source, pairs.target)
        T_true = pairs.T_target_source.to(pairs.source)
        T_true = between_centroids(T_true, encoded.source_mean, encoded.target_mean)
        x_0 = self.space.encode(T_true)
        where = transform(T_true, encoded.source.points)
        true = where, counterparts(where, encoded.target.points)
        found = [
            self.terms(*corrupt(x_0, self.alphas_bar, generator=generator), encoded, *true)[1]
            for _ in range(NOISY)
        ]
        x_t, t = self.beginnings(x_0, generator=generator)
        for _ in range(WALKED):
            T, terms = self.terms(x_t, t, encoded, *true)
            found.append(terms)
            x_t, t = self.space.encode(T.detach()), earlier(t, generator=generator)
        return {name: torch.stack([each[name] for each in found]).mean() for name in found[0]}

    def terms(
        self, x_t: Vectors, t: Times, encoded: Encoded, where: Sources, true: Counterparts
    ) -> tuple[Poses, Losses]:
        """The pose that follows x_t, and its loss; ``where`` the source's points truly lie."""
        matchable = self.matchable(x_t, t, encoded)
        T, matches = self.fit(matchable)
        return T, {
            "points": point_loss(transform(T, encoded.source.points), where),
            "matches": MATCH_WEIGHT * match_loss(matchable.scores(), true),
            "inliers": INLIER_WEIGHT * inlier_loss(matches),
        }

    def beginnings(self, x_0: Vectors, *, generator: torch.Generator) -> tuple[Vectors, Times]:
        """Where walks begin: every second one in the mode, the others in noise."""
        batch, mine = rows_drawn(len(x_0), generator)
        noise = torch.randn((batch, x_0.shape[1]), generator=generator)
        noise[::2] = 0
        t = torch.full((len(x_0),), len(self.alphas_bar) - 1, device=x_0.device)
        return noise[mine].to(x_0), t


def thinned(cloud: Float[Tensor, "batch n 3"]) -> Float[Tensor, "batch few 3"]:
    """At most ``MOST_POINTS`` of the points, evenly along their order."""
    n = cloud.shape[1]
    if n <= MOST_POINTS:
        return cloud
    return cloud[:, torch.linspace(0, n - 1, MOST_POINTS, device=cloud.device).long()]


def earlier(t: Times, *, generator: torch.Generator) -> Times:
    """A random time between a tenth and seven tenths of ``t``: what steps of a short walk skip."""
    batch, mine = rows_drawn(len(t), generator)
    share = 0.1 + 0.6 * torch.rand(batch, generator=generator)[mine].to(t.device)
    return (t * share).long().clamp(min=1)


def between_centroids(
    T_target_source: Poses,
    source_mean: Float[Tensor, "batch 3"],
    target_mean: Float[Tensor, "batch 3"],
) -> Poses:
    """The same motion for clouds that are moved so that these points are their origins."""
    eye = torch.eye(3).to(T_target_source).expand(len(T_target_source), 3, 3)
    return from_parts(eye, -target_mean) @ T_target_source @ from_parts(eye, source_mean)
