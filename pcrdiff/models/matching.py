"""Soft matches of two clouds: annealing parameters and Sinkhorn (Yew & Lee 2020, RPM-Net)."""

import torch
from jaxtyping import Float
from torch import Tensor, nn
from torch.nn.functional import pad, softplus

from pcrdiff.geometry.neighbors import squared_distances


class AnnealingNet(nn.Module):
    """Reads from both clouds how sharp (beta) and how generous (alpha) the matching may be."""

    def __init__(self) -> None:
        super().__init__()
        self.per_point = nn.Sequential(
            *(nn.Linear(4, 64), nn.ReLU(), nn.Linear(64, 64), nn.ReLU()),
            *(nn.Linear(64, 64), nn.ReLU(), nn.Linear(64, 128), nn.ReLU()),
            *(nn.Linear(128, 1024), nn.ReLU()),
        )
        self.head = nn.Sequential(
            *(nn.Linear(1024, 512), nn.ReLU(), nn.Linear(512, 256), nn.ReLU()),
            nn.Linear(256, 2),
        )

    def forward(
        self, source: Float[Tensor, "batch n 3"], target: Float[Tensor, "batch m 3"]
    ) -> tuple[Float[Tensor, " batch"], Float[Tensor, " batch"]]:
        """(alpha, beta), both positive, one of each per pair."""
        flagged = torch.cat([pad(source, (0, 1), value=0.0), pad(target, (0, 1), value=1.0)], 1)
        beta, alpha = softplus(self.head(self.per_point(flagged).amax(dim=1))).unbind(-1)
        return alpha, beta


def match_scores(
    source: Float[Tensor, "batch n dim"],
    target: Float[Tensor, "batch m dim"],
    alpha: Float[Tensor, " batch"],
    beta: Float[Tensor, " batch"],
) -> Float[Tensor, "batch n m"]:
    """``-beta (|f_x - f_y|^2 - alpha)``, the logarithm of the unnormalised matches."""
    distances = squared_distances(source, target)
    return -beta[:, None, None] * (distances - alpha[:, None, None])


def sinkhorn(scores: Float[Tensor, "batch n m"], iterations: int) -> Float[Tensor, "batch n m"]:
    """Matches whose rows and columns sum to at most 1, the rest being in a slack row and column.

    In logarithms. A row is normalised together with its slack place, a column with its own; the
    slack row and column are never normalised, so a point without a match finds room there.
    """
    log_matches = pad(scores, (0, 1, 0, 1), value=0.0)
    for _ in range(iterations):
        rows = log_matches[:, :-1] - log_matches[:, :-1].logsumexp(dim=-1, keepdim=True)
        log_matches = torch.cat([rows, log_matches[:, -1:]], dim=1)
        columns = log_matches[:, :, :-1] - log_matches[:, :, :-1].logsumexp(dim=1, keepdim=True)
        log_matches = torch.cat([columns, log_matches[:, :, -1:]], dim=2)
    return log_matches[:, :-1, :-1].exp()
