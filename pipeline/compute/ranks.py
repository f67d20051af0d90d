"""The processes of a training: this one alone, or several that Lightning Fabric brings together."""

import os
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from datetime import timedelta
from pathlib import Path
from typing import TYPE_CHECKING, TypeVar

import torch
from jaxtyping import Float
from torch import Tensor, distributed

from pcrdiff.registration import LearnedMethod
from pcrdiff.training.ranks import ALONE, Loss, Processes
from pipeline.compute.checkpoints import fingerprint
from pipeline.compute.machine import end_with_parent

if TYPE_CHECKING:
    from lightning_fabric import Fabric

T = TypeVar("T")

PATIENCE = timedelta(minutes=10)
"""Timeout for a silent peer; a dead one is detected immediately."""


class Together:
    """One of several processes, each on a GPU of its own, or on the CPU where there is none."""

    def __init__(self, fabric: "Fabric") -> None:
        """``fabric`` is launched."""
        self.fabric = fabric
        self.rank, self.count, self.device = fabric.global_rank, fabric.world_size, fabric.device

    def spread(self, method: LearnedMethod) -> Loss:
        """The loss under DistributedDataParallel."""
        module = self.fabric.setup(method)
        module.mark_forward_method("loss")
        loss: Loss = module.loss
        return loss

    def total(self, values: Float[Tensor, "*shape"]) -> Float[Tensor, "*shape"]:
        """The sum over the processes."""
        summed = values.to(self.device, copy=True)
        distributed.all_reduce(summed)
        return summed.to(values.device)

    def of_first(self, value: T) -> T:
        """What the first process holds."""
        return self.fabric.broadcast(value)


@contextmanager
def join(devices: int, nodes: int) -> Iterator[Processes]:
    """Start the others that are to train, or find them where a launcher has started them.

    Without a launcher each host's process starts ``devices - 1`` more by its own command line;
    ``torchrun`` and ``srun`` start all of them, which Fabric finds in the environment. Those that
    were started end with their launcher, however it ends.

    Raises:
        ValueError: The host has GPUs, but not one for each process; or a launcher has started
            another number of processes than the two numbers say.
        RuntimeError: Another process has ended before its time, so this one ends too.
    """
    if devices * nodes == 1:
        yield ALONE
        return
    if "LOCAL_RANK" in os.environ:  # a launcher has started this one, Fabric in the first perhaps
        end_with_parent()
    together = Together(_launch(devices, nodes))
    try:
        yield together
    except RuntimeError as error:
        if not (isinstance(error, distributed.DistError) or "gloo" in str(error).lower()):
            raise  # something that this process did
        raise RuntimeError(
            f"process {together.rank} of {together.count} ends because it has lost another; "
            "if that one could say why, it has"
        ) from error
    finally:
        distributed.destroy_process_group()


def check_agreement(
    processes: Processes, params: Mapping[str, object], made_of: Sequence[Path]
) -> None:
    """Make sure that all train the same method on the same pairs by the same code.

    Raises:
        FileNotFoundError: A file or folder of ``made_of`` is not there.
        ValueError: This process has other params, pairs or code than the first, or ``auto`` another meaning.
    """
    if processes.count == 1:
        return
    mine = fingerprint(params, made_of)
    if processes.of_first(mine) != mine:
        raise ValueError(
            f"process {processes.rank} has other params, pairs or code than the first; each host "
            "needs the same params.yaml, the same commit and the same data/pairs, and where "
            "search_precision is auto, a processor with bfloat16 as the others, or without as they"
        )


def _launch(devices: int, nodes: int) -> "Fabric":
    from lightning_fabric import Fabric  # seconds, which a process alone need not wait
    from lightning_fabric.strategies.ddp import DDPStrategy

    gpus = torch.cuda.device_count()
    if 0 < gpus < devices:
        raise ValueError(f"train.devices is {devices}, and this host has {gpus} GPUs")
    os.environ.setdefault("CUBLAS_WORKSPACE_CONFIG", ":4096:8")  # else its sums vary
    # Without a search for unused parameters, buckets are laid out again after the first step, and a
    # training that resumes from a checkpoint would sum in another order.
    strategy = DDPStrategy(timeout=PATIENCE, find_unused_parameters=True)
    fabric = Fabric(
        accelerator="cuda" if gpus else "cpu", devices=devices, num_nodes=nodes, strategy=strategy
    )
    fabric.launch()
    return fabric
