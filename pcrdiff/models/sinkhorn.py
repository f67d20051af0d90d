"""Sinkhorn's iterations with a slack row and column (Yew & Lee 2020, RPM-Net)."""

from collections.abc import Iterator
from typing import Any

import torch
from jaxtyping import Float
from torch import Tensor
from torch.autograd.function import once_differentiable

from pcrdiff.geometry.neighbors import BLOCK

LEAST_SLACK = 1e-30  # next to a row's best match; its inverse is still a float32


def sinkhorn(scores: Float[Tensor, "batch n m"], iterations: int) -> Float[Tensor, "batch n m"]:
    """Matches whose rows and columns sum to at most 1, the rest being in a slack row and column.

    A row is normalised together with its slack entry, a column with its own; the slack row and
    column themselves never are, so a point without a match finds room there. The matches are
    ``exp(scores)`` with each row and each column scaled, so only the scales are iterated. A row
    is measured against its largest score, or against the slack where that is larger. A column
    never sums to more than 1, a row only until the iterations have settled.
    """
    matches: Tensor = _Sinkhorn.apply(scores, iterations)  # type: ignore[no-untyped-call]
    return matches


class _Sinkhorn(torch.autograd.Function):
    """Pair by pair, so that a pair's kernel stays in the cache through all iterations.

    Every iteration adds to the kernel's gradient an outer product of a row's scale and a column's.
    The backward pass collects them and adds them at once, as one product of rank
    2 x ``iterations``.
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


def sinkhorn_product(
    left: Float[Tensor, "n factors"],
    right: Float[Tensor, "m factors"],
    values: Float[Tensor, "m dim"],
    iterations: int,
) -> Float[Tensor, "n dim"]:
    """``sinkhorn(left @ right.T) @ values`` of one pair, in memory linear in N + M.

    The kernel is computed again in each iteration, a block of rows at a time; only the scales of
    rows and columns are kept. Without a gradient.
    """
    columns = torch.ones_like(right[:, 0])
    for _ in range(iterations):
        rows, total = [], torch.ones_like(columns)
        for slack, kernel in _kernels(left, right):
            rows.append(1 / (kernel @ columns + slack))
            total += rows[-1] @ kernel
        columns = 1 / total
    scaled = columns.unsqueeze(-1) * values
    sums = [kernel @ scaled for _, kernel in _kernels(left, right)]
    return torch.cat(rows).unsqueeze(-1) * torch.cat(sums)


def _kernels(
    left: Float[Tensor, "n factors"], right: Float[Tensor, "m factors"]
) -> Iterator[tuple[Float[Tensor, " rows"], Float[Tensor, "rows m"]]]:
    """The slack and the kernel of each block of rows; each kernel overwrites the one before."""
    rows = max(1, BLOCK // len(right))
    buffer = left.new_empty(min(rows, len(left)), len(right))
    for block in torch.split(left, rows):
        kernel = torch.mm(block, right.mT, out=buffer[: len(block)])
        yield _fill_kernel(kernel, kernel), kernel
