"""Shapes in signatures are checked while the tests run; random cases are repeatable."""

import os
from collections.abc import Iterator
from pathlib import Path

import pytest
import torch
from hypothesis import settings
from jaxtyping import install_import_hook

install_import_hook(("pcrdiff", "pipeline.synthetic"), "beartype.beartype")
settings.register_profile("pcrdiff", deadline=None, derandomize=True)
settings.load_profile("pcrdiff")
torch.set_num_threads(1)
os.environ["DVC_NO_ANALYTICS"] = "1"  # else each of DVC's commands leaves a process that calls home

REPOSITORY = Path(__file__).resolve().parent.parent


@pytest.fixture(scope="session")
def real_data() -> Path:
    """The folder of real data sets; a test that asks for it is skipped where there is none."""
    told = os.environ.get("PCRDIFF_REAL_DATA")
    folder = Path(told) if told else REPOSITORY.parent / "shared" / "data"
    if not folder.is_dir():
        pytest.skip(f"no real data: {'PCRDIFF_REAL_DATA' if told else '../shared/data'} is absent")
    return folder


@pytest.fixture(autouse=True)
def unsettled() -> Iterator[None]:
    """Each test begins with a process that no stage has settled, whatever ran before it."""
    unsettle()
    yield
    unsettle()


def unsettle() -> None:
    """Undo what ``pipeline.compute.machine.settle`` does to torch."""
    from pcrdiff.geometry.precision import set_search_precision  # the hook above comes first

    set_search_precision("float32")
    torch.use_deterministic_algorithms(False)
    torch.set_flush_denormal(False)
    torch.set_num_threads(1)


@pytest.fixture(params=["with bfloat16", "without bfloat16"])
def processor(request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch) -> str:
    """A processor that says it multiplies in bfloat16, and one that says it does not."""
    has = request.param == "with bfloat16"
    said = {"amx_bf16": False, "avx512_bf16": has}
    monkeypatch.setattr(torch.cpu, "get_capabilities", lambda: said)
    return str(request.param)


@pytest.fixture(scope="session")
def repository() -> Path:
    """The project's own folder."""
    return REPOSITORY
