"""Soft matches of two clouds: annealing parameters and Sinkhorn (Yew & Lee 2020, RPM-Net)."""

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import torch
from jaxtyping import Float
from torch import Tensor, nn
from torch.autograd.function import once_differentiable
from torch.nn.functional import pad, softplus

from pcrdiff.geometry.neighbors import BLOCK
from pcrdiff.geometry.procrustes import fit_rigid
from pcrdiff.geometry.rigid import from_parts
from pcrdiff.models.mlp import he_layers
from pcrdiff.models.pointnet import PointNet

LEAST_WEIGHT = 1e-5  # RPM-Net's; next to a sum of matches, which is about 1
LEAST_SLACK = 1e-30  # next to a row's best match; its inverse is still a float32


class AnnealingNet(nn.Module):
    """Reads from both clouds how sharp (beta) and how generous (alpha) the matching may be."""

    def __init__(self) -> None:
        super().__init__()
        self.encoder = PointNet((64, 64, 64, 128, 1024), ins=4)
        self.head = nn.Sequential(*he_layers(1024, (512, 256)), nn.Linear(256, 2))

    def forward(
        self, source: Float[Tensor, "batch n 3"], target: Float[Tensor, "batch m 3"]
    ) -> tuple[Float[Tensor, " batch"], Float[Tensor, " batch"]]:
        """(alpha, beta), both positive, one of each per pair."""
        flagged = torch.cat([pad(source, (0, 1), value=0.0), pad(target, (0, 1), value=1.0)], 1)
        beta, alpha = softplus(self.head(self.encoder(flagged))).unbind(-1)
        return alpha, beta


def match_scores(
    source: Float[Tensor, "batch n dim"],
    target: Float[Tensor, "batch m dim"],
    alpha: Float[Tensor, " batch"],
    beta: Float[Tensor, " batch"],
) -> Float[Tensor, "batch n m"]:
    """``-beta (|f_x - f_y|^2 - alpha)``, the logarithm of the unnormalised matches."""
    left, right = _score_factors(source, target, alpha, beta)
    return left @ right.mT


def _score_factors(
    source: Float[Tensor, "batch n dim"],
    target: Float[Tensor, "batch m dim"],
    alpha: Float[Tensor, " batch"],
    beta: Float[Tensor, " batch"],
) -> tuple[Float[Tensor, "batch n dim+2"], Float[Tensor, "batch m dim+2"]]:
    """Whose product the scores are: all of ``|x|^2 - 2 xy + |y|^2`` in one sum of products.

    Features are counted from the target's mean, which no distance depends on: the smaller they
    are, the less of a distance is lost between its large terms.
    """
    middle = target.detach().mean(dim=1, keepdim=True)
    source, target = source - middle, target - middle
    beta_, alpha_ = beta[:, None, None], alpha[:, None, None]
    squares, others = (f.square().sum(dim=-1, keepdim=True) for f in (source, target))
    left = torch.cat([2 * beta_ * source, beta_ * (alpha_ - squares), torch.ones_like(squares)], -1)
    return left, torch.cat([target, torch.ones_like(others), -beta_ * others], -1)


def sinkhorn(scores: Float[Tensor, "batch n m"], iterations: int) -> Float[Tensor, "batch n m"]:
    """Matches whose rows and columns sum to at most 1, the rest being in a slack row and column.

    A row is normalised together with its slack place, a column with its own; the slack row and
    column themselves never are, so a point without a match finds room there. The matches are
    ``exp(scores)`` with each row and each column scaled, so only the scales are iterated. A row
    is measured against its largest score, or against the slack where that is larger. A column
    never sums to more than 1, a row only until the iterations have settled.
    """
    matches: Tensor = _Sinkhorn.apply(scores, iterations)  # type: ignore[no-untyped-call]
    return matches


class _Sinkhorn(torch.autograd.Function):
    """Pair by pair, so that a pair's kernel stays in the cache through all iterations.

    Every iteration adds to the kernel's gradient an outer product, of a row's scale and a column's;
    backward they are collected and added at once, as one product of rank 2 x ``iterations``.
    """

    @staticmethod
    def forward(ctx: Any, scores: Tensor, iterations: int) -> Tensor:  # noqa: ANN401
        kernels, matches = torch.empty_like(scores), torch.empty_like(scores)
        scales = []
        for score, kernel, match in zip(scores, kernels, matches, strict=True):
            slack = _fill_kernel(score, kernel)
            rows, columns = _iterate(kernel, slack, iterations)
            torch.mul(kernel, columns[-1], out=match).mul_(rows[-1].unsqueeze(-1))
            scales += [torch.stack(rows), torch.stack(columns)]
        ctx.save_for_backward(kernels, *scales)
        return matches

    @staticmethod
    @once_differentiable
    def backward(ctx: Any, gradient: Tensor) -> tuple[Tensor, None]:  # noqa: ANN401
        kernels, *scales = ctx.saved_tensors
        to_scores = torch.empty_like(kernels)
        for pair, (rows, columns) in enumerate(zip(scales[::2], scales[1::2], strict=True)):
            kernel, into = kernels[pair], to_scores[pair]
            pull = torch.mul(kernel, gradient[pair], out=into)
            to_rows, to_columns = pull @ columns[-1], rows[-1] @ pull
            lefts: list[Tensor] = []
            rights: list[Tensor] = []
            for row, column, before in zip(
                rows.flip(0), columns[1:].flip(0), columns[:-1].flip(0), strict=True
            ):
                to_columns = -to_columns * column.square()  # of the sum that column inverts
                lefts, rights = [*lefts, row], [*rights, to_columns]
                to_rows = -(to_rows + kernel @ to_columns) * row.square()
                lefts, rights = [*lefts, to_rows], [*rights, before]
                to_columns, to_rows = to_rows @ kernel, torch.zeros_like(to_rows)
            torch.mul(gradient[pair], columns[-1], out=into).mul_(rows[-1].unsqueeze(-1))
            into.addmm_(torch.stack(lefts, dim=1), torch.stack(rights)).mul_(kernel)
        return to_scores, None


def _fill_kernel(scores: Float[Tensor, "n m"], kernel: Float[Tensor, "n m"]) -> Float[Tensor, " n"]:
    """Write ``exp(scores)``, each row over its largest value, and return the slack so measured."""
    largest = scores.amax(dim=-1).clamp(min=0)
    torch.sub(scores, largest.unsqueeze(-1), out=kernel).exp_()
    return (-largest).exp().clamp(min=LEAST_SLACK)


def _iterate(
    kernel: Float[Tensor, "n m"], slack: Float[Tensor, " n"], iterations: int
) -> tuple[list[Float[Tensor, " n"]], list[Float[Tensor, " m"]]]:
    """The rows' and the columns' scales after each iteration, the columns' before the first too."""
    rows, columns = [], [torch.ones_like(kernel[0])]
    for _ in range(iterations):
        rows.append(1 / (kernel @ columns[-1] + slack))
        columns.append(1 / (rows[-1] @ kernel + 1))
    return rows, columns


def fit_matches(
    source: Float[Tensor, "batch n 3"],
    target: Float[Tensor, "batch m 3"],
    matches: Float[Tensor, "batch n m"],
) -> Float[Tensor, "batch 4 4"]:
    """T_target_source that carries each source point to the mean of its matches, by their weight.

    Yew & Lee 2020, Eqs. 4-5. A point that matches nothing pulls at nothing.
    """
    middle = target.mean(dim=1, keepdim=True)
    return _fit_sums(source, middle, matches @ (target - middle), matches.sum(dim=-1))


def _fit_sums(
    source: Float[Tensor, "batch n 3"],
    middle: Float[Tensor, "batch 1 3"],
    pulls: Float[Tensor, "batch n 3"],
    weights: Float[Tensor, "batch n"],
) -> Float[Tensor, "batch 4 4"]:
    """:func:`fit_matches`, given the rows' sums: of the matches, and of those times the target.

    The target counts from its ``middle``: where a cloud lies should cost its shape no digits.
    """
    matched = (pulls - LEAST_WEIGHT * middle) / (weights.unsqueeze(-1) + LEAST_WEIGHT)
    eye = torch.eye(3).to(middle).expand(len(middle), 3, 3)
    return from_parts(eye, middle.squeeze(1)) @ fit_rigid(source, matched, weights + 1e-8)


@dataclass(frozen=True)
class Matchable:
    """Two clouds and what their soft matches are made of."""

    source: Float[Tensor, "batch n 3"]
    target: Float[Tensor, "batch m 3"]
    source_features: Float[Tensor, "batch n dim"]
    target_features: Float[Tensor, "batch m dim"]
    alpha: Float[Tensor, " batch"]
    beta: Float[Tensor, " batch"]

    def matches(self, iterations: int) -> Float[Tensor, "batch n m"]:
        """:func:`sinkhorn` of the scores, all of them at once."""
        features = self.source_features, self.target_features
        return sinkhorn(match_scores(*features, self.alpha, self.beta), iterations)

    def fit(self, iterations: int) -> Float[Tensor, "batch 4 4"]:
        """:func:`fit_matches` of :meth:`matches`; without a graph, in memory linear in N + M."""
        n, m = self.source.shape[1], self.target.shape[1]
        if torch.is_grad_enabled() or n * m <= BLOCK:
            return fit_matches(self.source, self.target, self.matches(iterations))
        factors = _score_factors(self.source_features, self.target_features, self.alpha, self.beta)
        middle = self.target.mean(dim=1, keepdim=True)
        pairs = zip(*factors, self.target - middle, strict=True)
        sums = torch.stack([_sum_matches(*pair, iterations) for pair in pairs])
        return _fit_sums(self.source, middle, sums[..., :3], sums[..., 3])


def _sum_matches(
    left: Float[Tensor, "n factors"],
    right: Float[Tensor, "m factors"],
    target: Float[Tensor, "m 3"],
    iterations: int,
) -> Float[Tensor, "n 4"]:
    """Each row of the matches times the target's points, and its sum.

    The kernel is computed anew in each iteration, a block of rows at a time; what lasts are the
    scales of rows and columns.
    """
    columns = torch.ones_like(right[:, 0])
    for _ in range(iterations):
        rows, total = [], torch.ones_like(columns)
        for slack, kernel in _kernels(left, right):
            rows.append(1 / (kernel @ columns + slack))
            total += rows[-1] @ kernel
        columns = 1 / total
    points = columns.unsqueeze(-1) * nn.functional.pad(target, (0, 1), value=1.0)
    sums = [kernel @ points for _, kernel in _kernels(left, right)]
    return torch.cat(rows).unsqueeze(-1) * torch.cat(sums)


def _kernels(
    left: Float[Tensor, "n factors"], right: Float[Tensor, "m factors"]
) -> Iterator[tuple[Float[Tensor, " rows"], Float[Tensor, "rows m"]]]:
    """The slack and the kernel of each block of rows; the next kernel overwrites the last one."""
    rows = max(1, BLOCK // len(right))
    buffer = left.new_empty(min(rows, len(left)), len(right))
    for block in torch.split(left, rows):
        kernel = torch.mm(block, right.mT, out=buffer[: len(block)])
        yield _fill_kernel(kernel, kernel), kernel


def fit_pointers(
    source: Float[Tensor, "batch n 3"],
    target: Float[Tensor, "batch m 3"],
    source_features: Float[Tensor, "batch n dim"],
    target_features: Float[Tensor, "batch m dim"],
) -> Float[Tensor, "batch 4 4"]:
    """T_target_source that carries each source point to where it points among the target's.

    Wang & Solomon 2019 (DCP), Eqs. 10-15: a softmax over the target's points of the scaled dot
    products of the features, and a fit in which every source point weighs the same.
    """
    scores = source_features @ target_features.mT / source_features.shape[-1] ** 0.5
    return fit_rigid(source, scores.softmax(dim=-1) @ target, torch.ones_like(source[..., 0]))
