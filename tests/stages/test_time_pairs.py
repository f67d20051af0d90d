"""What a registration costs."""

import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest
import torch
from torch import Tensor

from pcrdiff.registration import Method
from pipeline.compute.machine import resident
from pipeline.settings.params import read_params
from stages.time import (
    COLUMNS,
    Cost,
    mean_seconds,
    time_all,
    time_registrations,
    write_costs,
)
from tests.described import REPOSITORY
from tests.pcrdiff.synthetic_clouds import seeded, synthetic_pairs
from tests.tiny import CF, PAIRS


class Slow(Method):
    """Takes its time and its memory, and fails on every pair but the first."""

    name = "slow"

    def __init__(self, mebibytes: int = 0) -> None:
        self.mebibytes = mebibytes
        self.calls = 0

    def answer(self, source: Tensor, target: Tensor, *, generator: torch.Generator) -> Tensor:
        """The identity, once."""
        del target, generator
        self.calls += 1
        time.sleep(0.02)
        np.ones(self.mebibytes << 20, np.uint8)
        if self.calls > 1:
            raise ValueError("enough")
        return torch.eye(4).expand(len(source), 4, 4)


def test_every_pair_is_timed_after_the_warm_up_even_where_the_method_fails() -> None:
    method, pairs = Slow(), synthetic_pairs(3, 20, generator=seeded(0))
    costs = time_registrations(method, pairs, warm_up=2, before=resident("VmRSS"))
    assert method.calls == 5
    assert len(costs) == 3
    assert all(0.02 <= cost.seconds < 1 for cost in costs)


IN_A_FRESH_PROCESS = """
from tests.stages.test_time_pairs import Slow
from pcrdiff.registration import Method
from tests.pcrdiff.synthetic_clouds import synthetic_pairs, seeded
from pipeline.compute.machine import resident
from stages.time import time_registrations
pairs = synthetic_pairs(2, 20, generator=seeded(0))
before = resident("VmRSS")
for mebibytes in (64, 1):  # the second setting has what the first allocated
    costs = time_registrations(Slow(mebibytes), pairs, warm_up=1, before=before)
    print(*(cost.peak_memory_mib for cost in costs))
"""


def test_memory_is_what_the_registration_needs_above_what_was_there() -> None:
    command = [sys.executable, "-c", IN_A_FRESH_PROCESS]  # this one has freed memory to spare
    done = subprocess.run(command, cwd=REPOSITORY, check=True, capture_output=True, text=True)
    much, little = done.stdout.splitlines()
    assert all(60 <= float(mebibytes) < 100 for mebibytes in much.split())
    assert all(0 < float(mebibytes) < 40 for mebibytes in little.split())


def test_every_method_is_timed_in_each_of_its_settings_on_as_many_pairs_as_asked(
    project: Path,
) -> None:
    params = read_params()
    found = dict(time_all(params, project / PAIRS, Path("models")))
    assert list(found) == [*params.run.classical, *params.run.diffused, *params.run.baselines]
    assert {name: len(costs) for name, costs in found[CF].items()} == {"paper": 2}
    assert {name: len(costs) for name, costs in found["icp"].items()} == {"paper": 2, "official": 2}


ALONE = """
import os
from stages.time import in_a_child
def fail():
    raise ValueError("no weights")
print(len({os.getpid(), in_a_child(os.getpid), in_a_child(os.getpid)}))
for work in (fail, lambda: os._exit(3)):
    try:
        in_a_child(work)
    except (ValueError, RuntimeError) as error:
        print(error)
"""


def test_each_method_is_timed_in_a_process_of_its_own_which_says_how_it_fails() -> None:
    command = [sys.executable, "-c", ALONE]
    done = subprocess.run(command, cwd=REPOSITORY, check=True, capture_output=True, text=True)
    assert done.stdout.splitlines() == [
        "3",
        "no weights",
        "a timed method ended its process, exit code 3",
    ]


def test_more_pairs_than_there_are_is_refused_in_a_sentence(project: Path) -> None:
    params = read_params()
    many = params.timing.model_copy(update={"pairs": 4000})
    asked = params.model_copy(update={"timing": many})
    with pytest.raises(ValueError, match=r"timing.pairs needs at most the 3 test pairs, got 4000"):
        next(time_all(asked, project / PAIRS, Path("models")))


def test_a_row_a_setting_and_pair_is_written_and_the_means_are_told(tmp_path: Path) -> None:
    costs = {"paper": [Cost(0.25, 1.5), Cost(0.75, 2.5)], "official": [Cost(1.0, 0.0)]}
    write_costs(tmp_path / "x.csv", costs)
    lines = (tmp_path / "x.csv").read_text().splitlines()
    assert lines == [
        ",".join(COLUMNS),
        "0,paper,0.25,1.5",
        "1,paper,0.75,2.5",
        "0,official,1.0,0.0",
    ]
    assert mean_seconds(costs) == 0.5
