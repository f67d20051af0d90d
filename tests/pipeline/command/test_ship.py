"""Weights that come with the code: what is kept of a training, and what their card says."""

from pathlib import Path

import pytest
import torch

from pipeline.command.ship import ship, write_card
from pipeline.formats.pairs import read_pairs
from pipeline.formats.weights import read_facts, read_weights, shipped_setting, write_weights
from pipeline.loading import load_shipped
from pipeline.settings.params import read_params
from stages.evaluate import main as evaluate
from tests.tiny import CF, PAIRS, SCENARIO, weights


@pytest.fixture
def own_code(request: pytest.FixtureRequest) -> Path:
    """The project with a folder ``pcrdiff`` of its own, since the made one's is a link."""
    request.getfixturevalue("project")
    Path("pcrdiff").unlink()
    return Path()


def test_what_is_shipped_is_the_training_in_half_the_room(own_code: Path) -> None:
    shipped, card = ship(own_code, CF, SCENARIO)
    assert shipped == Path("pcrdiff/weights", CF, f"{SCENARIO}.safetensors")
    assert read_facts(shipped) == read_facts(weights(CF))
    before, after = read_weights(weights(CF), CF), read_weights(shipped, CF)
    assert before.keys() == after.keys()
    for name, value in before.items():
        assert after[name].dtype == torch.float32
        torch.testing.assert_close(after[name], value, atol=1e-3, rtol=1e-3)
    assert shipped.stat().st_size < 0.7 * weights(CF).stat().st_size
    said = card.read_text(encoding="utf-8")
    assert "`modelnet40` (local),\n  48 points" in said
    assert "3 epochs" in said
    assert "no profile holds this training" in said
    assert "Started" not in said


def test_a_card_names_the_profile_that_holds_such_a_training(own_code: Path) -> None:
    given = Path("params.yaml").read_text(encoding="utf-8")
    Path("profiles").mkdir(exist_ok=True)
    Path("profiles/quick.yaml").write_text(given, encoding="utf-8")
    said = ship(own_code, CF, SCENARIO)[1].read_text(encoding="utf-8")
    assert f"`pcrdiff profile quick`, `dvc repro train@{SCENARIO}-{CF}`" in said
    other = read_facts(weights(CF)) | {"start": "kitti", "start_md5": "d41d8c"}
    write_weights(weights(CF), read_weights(weights(CF), CF), other)
    assert "profile quick" not in ship(own_code, CF, SCENARIO)[1].read_text(encoding="utf-8")


def test_a_card_says_what_the_training_started_from(own_code: Path) -> None:
    facts = read_facts(weights(CF)) | {"start": "kitti", "start_md5": "d41d8c"}
    write_weights(weights(CF), read_weights(weights(CF), CF), facts)
    said = ship(own_code, CF, SCENARIO)[1].read_text(encoding="utf-8")
    assert (
        "- **Started** from the network for `kitti` that came with the code, md5\n  `d41d8c`"
        in said
    )


def test_the_network_is_the_one_of_the_weights_whatever_params_say(own_code: Path) -> None:
    shipped, _ = ship(own_code, CF, SCENARIO)
    params = read_params()
    section = params.methods.pcrdiffusion_cf
    other = section.model_copy(
        update={"network": section.network.model_copy(update={"feature_dim": 24})}
    )
    methods = params.methods.model_copy(update={CF: other})
    loaded = load_shipped(params.model_copy(update={"methods": methods}), CF, shipped)
    assert set(loaded) == {"paper"}
    trained = load_shipped(params, CF, weights(CF))["paper"]
    test = read_pairs(PAIRS, "test")
    answers = [
        method.register(test.source, test.target, generator=torch.Generator().manual_seed(1))
        for method in (loaded["paper"], trained)
    ]
    torch.testing.assert_close(*answers, atol=0.01, rtol=0)


def test_evaluated_they_stand_beside_those_trained_here_and_their_card_has_errors(
    own_code: Path,
) -> None:
    ship(own_code, CF, SCENARIO)
    folder, answers = Path("pcrdiff/weights", CF), Path("results/shipped", CF)
    evaluate(
        [
            "--method",
            CF,
            "--pairs",
            "data/pairs",
            "--shipped",
            str(folder),
            "--answers",
            str(answers),
        ]
    )
    rows = (answers / f"{SCENARIO}.csv").read_text(encoding="utf-8").splitlines()
    assert all(",shipped," in row for row in rows[1:])
    assert (answers / f"{SCENARIO}.json").is_file()
    said = write_card(own_code, CF, SCENARIO).read_text(encoding="utf-8")
    assert "| paper | 3 |" in said


@pytest.mark.usefixtures("own_code")
def test_refuses_a_folder_without_weights_for_any_scenario() -> None:
    folder = Path("pcrdiff/weights", CF)
    folder.mkdir(parents=True)
    with pytest.raises(ValueError, match=f"{folder} needs weights for one of"):
        evaluate(["--method", CF, "--pairs", "data/pairs", "--shipped", str(folder),
                  "--answers", "results/none"])  # fmt: skip


@pytest.mark.usefixtures("project")
def test_refuses_weights_of_another_network() -> None:
    with pytest.raises(ValueError, match="is of a network that pcrdiffusion_cb is not"):
        load_shipped(read_params(), "pcrdiffusion_cb", weights(CF))


@pytest.mark.usefixtures("project")
def test_refuses_a_training_that_is_not_there() -> None:
    with pytest.raises(FileNotFoundError, match="weights are needed at"):
        ship(Path(), CF, "kitti")


def test_the_papers_setting_is_not_named() -> None:
    assert shipped_setting("paper") == "shipped"
    assert shipped_setting("four_steps") == "shipped four_steps"
