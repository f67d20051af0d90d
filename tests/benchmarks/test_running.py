"""The command: a tiny run in a project of boxes, and what it writes when."""

from pathlib import Path

import pytest

from benchmarks import inputs, running
from benchmarks.effort import DRY, FULL, Effort
from benchmarks.measuring import Comparison, compare
from benchmarks.running import FIRST, main, measure
from pipeline.formats.benchmarks import Benchmarks, PeakMemory, read_benchmarks, write_benchmarks
from pipeline.formats.files import read_csv
from pipeline.formats.weights import write_weights
from pipeline.loading import build_untrained
from pipeline.settings.params import Params, read_params
from tests.described import REPOSITORY, expand, read_repository_params
from tests.tiny import CB, CF, SCENARIO, instance, run_instance

COLUMNS = ["name", "ratio", "ours", "peer", "unit", "n", "spread", "environment"]


@pytest.fixture
def boxes(blank: Path, monkeypatch: pytest.MonkeyPatch) -> Params:
    """A project of boxes with untrained weights, as the current folder."""
    monkeypatch.setattr(inputs, "SCENARIO", SCENARIO)
    monkeypatch.setattr(inputs, "PROJECT", REPOSITORY)
    run_instance(instance("acquire@modelnet40"))
    params = read_params()
    for name in params.trainings:
        weights = build_untrained(name, params.methods, params.diffusion).state_dict()
        write_weights(blank / inputs.weights_of(name), weights, {"method": name})
    return params


def test_a_tiny_run_measures_every_method_and_writes_what_it_found(
    boxes: Params, tmp_path: Path
) -> None:
    found = measure(boxes, ["training", "registration", "ceilings"], DRY)
    names = [each.name for each in found.ratios]
    assert names[:3] == [name for name in FIRST if name.startswith("cf_")]
    assert "cb_train_step_vs_plain" in names
    assert {each.method for each in found.latencies} == {*boxes.run.classical, *boxes.trainings}
    assert {(each.method, each.points) for each in found.latencies} >= {(CF, 64), (CF, 32)}
    assert len({each.environment for each in found.ratios}) == 1
    write_benchmarks(tmp_path, found)
    header, rows = read_csv(tmp_path / "speed.csv")
    assert header == COLUMNS
    for row in rows:
        ratio, ours, peer = map(float, row[1:4])
        better, worse = (peer, ours) if row[4] == "ms" else (ours, peer)
        assert ratio == pytest.approx(better / worse, rel=1e-3)
    again = read_benchmarks(tmp_path)
    assert again is not None
    assert [each.name for each in again.ratios] == names
    assert [each.n for each in again.latencies] == [each.n for each in found.latencies]


def test_the_stages_asked_for_are_those_of_dvc_yaml(capsys: pytest.CaptureFixture[str]) -> None:
    main(["--stages"])
    said = capsys.readouterr().out.split()
    stages = {each.name for each in expand(read_repository_params())}
    assert (
        {"train@modelnet40-gaussian_noise-pcrdiffusion_cf", "train_baselines@rpmnet"}
        < {*said}
        <= stages
    )


def faked(part: str, _params: Params, effort: Effort, environment: str) -> Benchmarks:
    """Measures nothing."""
    assert part == "memory"
    ratio = compare(Comparison("x", [1.0], [2.0], "s", higher_is_better=False), environment)
    memory = PeakMemory(CB, effort.points, 9.0, 0.5, environment)
    return Benchmarks(ratios=[ratio], memory=[memory])


@pytest.mark.parametrize(
    ("argv", "written"),
    [([], True), (["--dry"], False), (["--only", "memory"], False)],
)
def test_only_a_whole_run_is_written(
    argv: list[str],
    written: bool,
    blank: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    monkeypatch.setattr(running, "PARTS", ["memory"])
    monkeypatch.setattr(running, "measure_part", faked)
    main(argv)
    assert "2.00 x" in capsys.readouterr().out
    assert (blank / "benchmarks" / "speed.csv").exists() is written
    if written:
        found = read_benchmarks(blank / "benchmarks")
        assert found is not None
        assert found.memory[0].points == FULL.points
