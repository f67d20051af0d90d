"""How much is measured: everything, or next to nothing to see that it runs."""

from dataclasses import dataclass


@dataclass(frozen=True)
class Effort:
    """The sizes of one run."""

    repeats: int
    """Repetitions of a training step, a loop, a ceiling."""
    rounds: int
    """In which every method registers its pairs once."""
    pairs: int
    """To register: at batch 1, and all of them at once."""
    points: int
    """Points of a cloud that is registered."""
    subset: int
    """Points that CF is given in its extra row."""
    seconds: float
    """Seconds that a method may take per round for single pairs; a slow one gets fewer pairs."""
    least: int
    """Pairs of the slowest method in a round."""
    cf_step: tuple[int, int]
    cb_step: tuple[int, int]
    """Pairs and points of a training step."""
    memory_points: tuple[int, ...]
    gemm: int
    """Side of the large matrix product."""


FULL = Effort(
    repeats=9,
    rounds=3,
    pairs=64,
    points=2048,
    subset=512,
    seconds=4.0,
    least=6,
    cf_step=(32, 1024),
    cb_step=(8, 512),
    memory_points=(512, 1024, 2048, 4096, 8192, 16384),
    gemm=2048,
)
DRY = Effort(
    repeats=1,
    rounds=1,
    pairs=2,
    points=64,
    subset=32,
    seconds=0.1,
    least=1,
    cf_step=(2, 64),
    cb_step=(2, 64),
    memory_points=(128, 256),
    gemm=64,
)
