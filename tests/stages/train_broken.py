"""The train stage, in which one of two processes meets its end in the second epoch.

``python -m tests.stages.train_broken HOW WHO ARGUMENTS``: HOW is ``killed`` or ``raises``, WHO the
process; the arguments are the stage's. The second process is started by the same command line.
"""

import os
import signal
import sys

from pcrdiff.training.loop import Trainer
from pipeline.compute import checkpoints
from pipeline.compute.stage import run
from stages.train import main

run_whole_epoch = Trainer.run_epoch


def run_epoch(self: Trainer, epoch: int) -> None:
    """An epoch, but for the second of the process that is to end."""
    if epoch == 1 and self.processes.rank == int(sys.argv[2]):
        if sys.argv[1] == "killed":
            os.kill(os.getpid(), signal.SIGKILL)
        raise ValueError("a deliberate mistake")
    run_whole_epoch(self, epoch)


if __name__ == "__main__":
    checkpoints.SECONDS_BETWEEN = 0.0
    Trainer.run_epoch = run_epoch  # type: ignore[method-assign]
    run(lambda: main(sys.argv[3:]), "train")
