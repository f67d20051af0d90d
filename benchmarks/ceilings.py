"""(v) How far each hot loop is from what the machine can do, both measured in the same run."""

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass

import torch
from torch import nn

from benchmarks.effort import Effort
from benchmarks.measuring import Summary, alternate, summarise
from pcrdiff.geometry.precision import multiplies_in_bfloat16
from pcrdiff.models.losses import chamfer_loss
from pcrdiff.models.pointnet import PointNet
from pcrdiff.models.sinkhorn import sinkhorn
from pcrdiff.models.structure import DESCRIPTOR_DIM, StructureEmbedding
from pipeline.formats.benchmarks import Ceiling

WIDTHS = (64, 64, 64, 128, 1024)  # the paper's encoder
DIM, NEIGHBOURS, SINKHORN = 128, 16, 5  # the paper's CB
WARM_UP = 2
FLOAT = 4  # bytes


@dataclass(frozen=True)
class Work:
    """A call, and the least arithmetic and traffic that it can do with."""

    name: str
    call: Callable[[], object]
    flop: float
    traffic: float
    """Bytes: operands and results once; a matrix beyond the caches each time it is gone through."""
    kind: str = "loop"


def measure_ceilings(effort: Effort, environment: str) -> list[Ceiling]:
    """Matrix products and a copy, then the loops, all in turn."""
    works = [*machine_works(effort), *cf_loops(effort), *cb_loops(effort.points)]
    seconds = alternate([work.call for work in works], effort.repeats, WARM_UP)
    taken = list(zip(works, map(summarise, seconds), strict=True))
    products = [each for each in taken if each[0].name.endswith("float32 product")]
    gemm = max(work.flop / took.median for work, took in products)
    copy = next(work.traffic / took.median for work, took in taken if work.name == "copy")
    return [row(work, took, gemm, copy, environment) for work, took in taken]


def row(work: Work, took: Summary, gemm: float, copy: float, environment: str) -> Ceiling:
    """What a call reached, beside the rates of the machine in FLOP/s and bytes/s."""
    flops, traffic = work.flop / took.median, work.traffic / took.median
    return Ceiling(
        name=work.name,
        kind=work.kind,
        ms=1e3 * took.median,
        spread_ms=1e3 * took.spread,
        n=took.n,
        gflop_per_s=flops / 1e9,
        gflop_share=flops / gemm,
        gbyte_per_s=traffic / 1e9,
        gbyte_share=traffic / copy,
        environment=environment,
    )


def machine_works(effort: Effort) -> Iterable[Work]:
    """Products of a large shape and of one cloud's widest layer, and a copy beyond the caches."""
    side, points = effort.gemm, effort.cf_step[1]
    fast = (torch.float32, torch.bfloat16) if multiplies_in_bfloat16() else (torch.float32,)
    for dtype in fast:  # emulated, bfloat16 takes minutes
        name = str(dtype).removeprefix("torch.")
        yield product(f"large {name} product", (side, side, side), dtype)
        yield product(f"one cloud's {name} product", (WIDTHS[-1], WIDTHS[-2], points), dtype)
    block = torch.zeros(8 * side * side)
    other = torch.empty_like(block)
    traffic = 2 * FLOAT * block.numel()
    yield Work("copy", lambda: other.copy_(block), 0.0, traffic, "machine")


def product(name: str, shape: tuple[int, int, int], dtype: torch.dtype) -> Work:
    """``[n k] @ [k m]``."""
    n, k, m = shape
    a, b, out = (torch.ones(size, dtype=dtype) for size in ((n, k), (k, m), (n, m)))
    traffic = a.element_size() * (n * k + k * m + n * m)
    flop = 2.0 * n * k * m
    return Work(name, lambda: torch.matmul(a, b, out=out), flop, traffic, "machine")


@torch.no_grad()
def cf_loops(effort: Effort) -> Iterable[Work]:
    """What CF repeats in every step, in training and for one pair."""
    batch, points = effort.cf_step
    n = effort.points
    generator = torch.Generator().manual_seed(0)
    clouds = torch.rand(batch, points, 3, generator=generator)
    single = torch.rand(1, n, 3, generator=generator)
    encoder = PointNet(WIDTHS)
    yield Work(
        "PointNet, forward in training",
        lambda: with_graph(encoder, clouds),
        linear_flop(encoder, batch * points),
        FLOAT * (clouds.numel() + batch * WIDTHS[-1]),
    )
    yield Work(
        "PointNet, inference of one cloud",
        lambda: without_graph(encoder, single),
        linear_flop(encoder, n),
        FLOAT * (single.numel() + WIDTHS[-1]),
    )
    yield Work(
        "chamfer, nearest both ways",
        lambda: chamfer_loss(clouds, clouds.flip(1)),
        2 * 8.0 * batch * points**2,  # a product of 3 and 1 terms, and a comparison
        FLOAT * 2 * clouds.numel(),
    )


@torch.no_grad()
def cb_loops(n: int) -> Iterable[Work]:
    """What CB repeats in every step, on clouds of ``n`` points."""
    generator = torch.Generator().manual_seed(1)
    embedding = StructureEmbedding(DIM, DESCRIPTOR_DIM)
    descriptors = torch.rand(1, n, NEIGHBOURS, DESCRIPTOR_DIM, generator=generator)
    yield Work(
        "CB, embedding of one cloud",
        lambda: without_graph(embedding, descriptors),
        linear_flop(embedding.per_neighbour, n * NEIGHBOURS) + linear_flop(embedding.per_point, n),
        FLOAT * (descriptors.numel() + n * DIM),
    )
    scores = -torch.rand(1, n, n, generator=generator)
    yield Work(
        f"Sinkhorn, {SINKHORN} iterations",
        lambda: sinkhorn(scores, SINKHORN),
        2 * 2.0 * SINKHORN * n**2,
        FLOAT * (2 * SINKHORN + 2) * n**2,
    )


def with_graph(network: nn.Module, inputs: torch.Tensor) -> None:
    """Forward as training does it."""
    with torch.enable_grad():
        network(inputs)


@torch.no_grad()
def without_graph(network: nn.Module, inputs: torch.Tensor) -> None:
    """Forward as inference does it."""
    network(inputs)


def linear_flop(network: nn.Module, rows: int) -> float:
    """The FLOP of all linear layers on ``rows`` rows: a product and a sum per weight."""
    layers: Sequence[nn.Linear] = [m for m in network.modules() if isinstance(m, nn.Linear)]
    return 2.0 * rows * sum(layer.weight.numel() for layer in layers)
