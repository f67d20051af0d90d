"""Read what a report is made from: answers, times, trainings, pair files, walks. Checked first."""

import json
from collections.abc import Collection, Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path
from types import MappingProxyType
from typing import Any

import numpy as np
import pandas as pd

from pcrdiff.geometry.metrics import RIGHT_DEG, RIGHT_T
from pcrdiff.registration import Pairs
from pcrdiff.verdict import Verdict
from pipeline.formats.answers import ANSWER, CHAMFER, JUDGED, PROBABILITY
from pipeline.formats.files import read_csv
from pipeline.formats.pairs import read_attributes, read_pairs
from pipeline.formats.verdicts import VERDICTS, read_verdicts
from pipeline.formats.walks import RecordedWalk, read_walks
from pipeline.formats.weights import CURVE, FACTS, SHIPPED
from pipeline.reporting.paper import ABLATIONS as ABLATED
from pipeline.reporting.paper import TIMING, UNSEEN_OBJECTS, place

EULER = ["rx_deg", "ry_deg", "rz_deg"]
SHIFT = ["tx", "ty", "tz"]
NUMBERS = ANSWER[5:]
"""The columns of an answer that hold numbers: errors, differences by axis, the pose."""
ABLATIONS, TIMES, WALKS = "ablations", "times", "walks"
"""Folders beside those of the methods."""
NOISE, STARTS = "noise", "starts"
"""The ablations that have a folder: of files for each method, and for each scenario."""
HOW_MANY = r"(\w+,)?starts=[1-9]\d*"
"""A setting of the ablation of starts: that of their source, and how many there were."""
MAY_LACK = [CHAMFER, *JUDGED]
"""The columns of an answer that may be empty, or missing from a file."""
TIMED = ["seconds", "peak_memory_mib"]
SET = ["table", "ablation", "scenario", "method", "setting", "draw"]
"""What the answers of one set have in common; a further draw of the noise is a set of its own."""
Verdicts = Mapping[tuple[str, str, str], Verdict]
"""By scenario, method and setting."""


def choose(frame: pd.DataFrame, **wanted: object) -> pd.DataFrame:
    """Keep the rows of a frame that have these values in these columns."""
    for name, value in wanted.items():
        frame = frame[frame[name] == value]
    return frame


def read_answers(folder: Path, verdicts: Verdicts = MappingProxyType({})) -> pd.DataFrame:
    """Read ``<method>/<scenario>.csv``, ``shipped/*/*.csv``, ``ablations/*.csv``, ``ablations/*/*.csv``.

    Returns:
        A row for each answer to a pair, in the order of the sets and of the pairs. Besides the
        columns of the files: ``table`` (the paper's, or ``extra``), ``ablation`` (empty for a main
        table), ``scenario``, ``method``, ``draw`` (0 for the first), ``failed``, ``right`` (off by
        less than 5 degrees and 0.1), ``trusted`` (by the verdict of its set), and ``headline``,
        which marks one set of each method on each scenario: the paper's setting, else the first.
        What speaks for an answer, and its ``probability``, are NaN where nothing was said, and
        ``chamfer_ratio`` where no shape was known.

    Raises:
        FileNotFoundError: There is none.
        ValueError: One is cut short or ill-formed, its pairs are not those of its neighbours, it
            has probabilities that are of no verdict, or does not say how many starts it is of.
    """
    main = [file for file in folder.glob("*/*.csv") if file.parent.name != TIMES]
    deeper = (f"{ABLATIONS}/{NOISE}", f"{ABLATIONS}/{STARTS}", f"{SHIPPED}/*")
    files = sorted([*main, *(file for name in deeper for file in folder.glob(f"{name}/*.csv"))])
    if not files:
        raise FileNotFoundError(f"{folder} needs a <method>/<scenario>.csv, found none")
    answers = pd.concat([_read_texts(file) for file in files], ignore_index=True)
    drawn = answers["setting"].str.partition(",draw=")
    answers = answers.assign(
        setting=drawn[0],
        draw=drawn[2].where(drawn[2] != "", "0").astype(int),
        failed=answers["failure"] != "",
        **_numbers(answers, ["pair", *NUMBERS]),
        **_known_numbers(answers, MAY_LACK),
    )
    _check_one_row_per_pair(answers)
    _check_same_pairs(answers)
    _check_starts(answers)
    near = (answers["error_r_deg"] < RIGHT_DEG) & (answers["error_t"] < RIGHT_T)
    answers = answers.assign(right=near & ~answers["failed"], trusted=_trusted(answers, verdicts))
    return _in_order(answers)


def _trusted(answers: pd.DataFrame, verdicts: Verdicts) -> pd.Series:
    """Say which answers are trusted; never one without a probability."""
    trusted = pd.Series(data=False, index=answers.index)
    known = answers[answers[PROBABILITY].notna()]
    for keys, rows in known.groupby(["scenario", "method", "setting"]):
        file, probability = rows["file"].iloc[0], rows[PROBABILITY].to_numpy()
        if keys not in verdicts:
            raise ValueError(f"{file} needs the verdict that its probabilities of {keys[2]} are of")
        if (probability < 0).any() or (probability > 1).any():
            raise ValueError(f"{file} needs probabilities in [0, 1], has others")
        trusted[rows.index] = verdicts[keys].trusts(probability)
    return trusted


def read_all_verdicts(results: Path) -> Verdicts:
    """Read every ``<method>/verdicts/<scenario>.json``, those of ``shipped`` too; none is fine.

    Raises:
        ValueError: One is cut short or ill-formed.
    """
    files = [*results.glob(f"*/{VERDICTS}/*.json"), *results.glob(f"{SHIPPED}/*/{VERDICTS}/*.json")]
    return {
        (file.stem, file.parent.parent.name, setting): verdict
        for file in sorted(files)
        for setting, verdict in read_verdicts(file).items()
    }


def _read_texts(file: Path) -> pd.DataFrame:
    """Read one file of answers, every field a text, and say whose its rows are."""
    folder, name = file.parent.name, file.stem
    if folder not in (ABLATIONS, NOISE, STARTS):
        answers, table = _read_columns(file, ANSWER, MAY_LACK), place(name).table
        answers = pd.DataFrame({**dict.fromkeys(MAY_LACK, ""), **answers})
        return answers.assign(method=folder, scenario=name, table=table, ablation="")
    ablation = name if folder == ABLATIONS else folder
    table = ABLATED[ablation].table if ablation in ABLATED else "extra"
    answers = _read_columns(file, ["method", *ANSWER], ["scenario", *MAY_LACK])
    scenario = name if folder == STARTS else UNSEEN_OBJECTS
    unsaid = {"scenario": scenario, **dict.fromkeys(MAY_LACK, "")}
    return pd.DataFrame({**unsaid, **answers}).assign(table=table, ablation=ablation)


def _read_columns(file: Path, needed: list[str], others: Collection[str] = ()) -> pd.DataFrame:
    """Read a file's texts, and which file it is; only ``others`` may stand beside ``needed``."""
    header, rows = read_csv(file)
    missing, unknown = sorted({*needed} - {*header}), sorted({*header} - {*needed, *others})
    if missing:
        raise ValueError(f"{file} needs the columns {', '.join(missing)}, it lacks them")
    if unknown:
        raise ValueError(f"{file} has columns nobody here reads: {', '.join(unknown)}")
    return pd.DataFrame(rows, columns=header).assign(file=str(file))


def read_times(folder: Path) -> pd.DataFrame:
    """Read every ``times/<method>.csv``, and ``times/starts.csv`` of several; none is fine.

    Returns:
        The columns of :func:`read_answers` that say whose an answer is, ``failed`` (False: a pair
        that failed took its time too) and ``TIMED``: seconds, and MiB of memory above those of the
        loaded process. ``scenario`` is empty for starts whose file has no such column.

    Raises:
        ValueError: One is cut short, has other columns, has a pair twice, or no time above zero.
    """
    needed, whose = ["pair", "setting", *TIMED], ["table", "ablation", "scenario", "method"]
    empty = pd.DataFrame(columns=[*needed, *whose, "file"])
    texts = [_read_timed(file, needed) for file in sorted(folder.glob(f"{TIMES}/*.csv"))]
    times = pd.concat([empty, *texts], ignore_index=True)
    times = times.assign(draw=0, failed=False, **_numbers(times, ["pair", *TIMED]))
    wrong = times.loc[(times["seconds"] <= 0) | (times["peak_memory_mib"] < 0), "file"]
    if len(wrong):
        raise ValueError(f"{wrong.iloc[0]} needs times above zero and memory not below, has others")
    _check_one_row_per_pair(times)
    _check_starts(times)
    return _in_order(times)


def _read_timed(file: Path, needed: list[str]) -> pd.DataFrame:
    """Read one file of times, every field a text, and say whose its rows are."""
    if file.stem != STARTS:
        own = {"table": TIMING.table, "ablation": "", "scenario": UNSEEN_OBJECTS}
        return _read_columns(file, needed).assign(method=file.stem, **own)
    times = pd.DataFrame({"scenario": "", **_read_columns(file, ["method", *needed], ["scenario"])})
    return times.assign(table=ABLATED[STARTS].table, ablation=STARTS)


def _in_order(rows: pd.DataFrame) -> pd.DataFrame:
    """Sort the sets, and mark the headline of each method on each scenario."""
    rows = rows.drop(columns="file").sort_values([*SET, "pair"], ignore_index=True)
    main = rows[rows["ablation"] == ""]
    ranked = main["setting"].where(main["setting"] != "paper", "")  # before all others
    chosen = ranked.groupby([main["scenario"], main["method"]]).transform("min")
    return rows.assign(headline=(ranked == chosen).reindex(rows.index, fill_value=False))


def _numbers(rows: pd.DataFrame, columns: list[str]) -> dict[str, np.ndarray]:
    """Turn columns of texts into numbers, and refuse what is none."""
    numbers = {}
    for name in columns:
        values = np.array([_number(text) for text in rows[name]], dtype=float)
        wrong = rows[~np.isfinite(values)]
        if len(wrong):
            file, text = wrong.iloc[0][["file", name]]
            raise ValueError(f"{file} needs a finite number in column {name}, got {text!r}")
        numbers[name] = values.astype(int) if name == "pair" else values
    return numbers


def _known_numbers(rows: pd.DataFrame, columns: list[str]) -> dict[str, pd.Series]:
    """The same of columns that may be empty: NaN there."""
    numbers = {}
    for name in columns:
        known = rows[rows[name] != ""]
        values = _numbers(known, [name])[name]
        numbers[name] = pd.Series(values, known.index).reindex(rows.index)
    return numbers


def _number(text: str) -> float:
    try:
        return float(text)
    except ValueError:
        return np.nan


def _check_one_row_per_pair(rows: pd.DataFrame) -> None:
    twice = rows[rows.duplicated([*SET, "pair"])]
    if len(twice):
        file, pair, setting = twice.iloc[0][["file", "pair", "setting"]]
        raise ValueError(f"{file} needs one row per pair, has pair {pair} twice in {setting}")


def _check_same_pairs(answers: pd.DataFrame) -> None:
    wanted = answers.groupby(["ablation", "scenario"])["pair"].nunique()
    for keys, count in answers.groupby(["file", *SET])["pair"].nunique().items():
        file, _, ablation, scenario, method, setting, _ = keys
        if count != wanted[ablation, scenario]:
            raise ValueError(
                f"{file} needs all {wanted[ablation, scenario]} pairs its scenario was tried on,"
                f" has {count} under {method}, {setting}"
            )


def _check_starts(rows: pd.DataFrame) -> None:
    here = choose(rows, ablation=STARTS)
    wrong = here[~here["setting"].astype(str).str.fullmatch(HOW_MANY)]
    if len(wrong):
        file, setting = wrong.iloc[0][["file", "setting"]]
        raise ValueError(f"{file} needs settings like starts=4, paper,starts=4, has {setting!r}")


def read_all_walks(results: Path) -> dict[str, list[RecordedWalk]]:
    """Read every ``walks/<scenario>/<method>.csv``, by scenario; none is fine.

    Raises:
        ValueError: One is cut short or ill-formed.
    """
    walks: dict[str, list[RecordedWalk]] = {}
    for file in sorted(results.glob(f"{WALKS}/*/*.csv")):
        walks.setdefault(file.parent.name, []).extend(read_walks(file))
    return walks


@dataclass(frozen=True)
class Training:
    """What one training cost and how it went."""

    scenario: str
    method: str
    budget: dict[str, Any]
    """``epochs``, ``steps``, ``batch_size``, ``train_pairs``, ``parameters``, ``best_epoch``."""
    curve: pd.DataFrame
    """A row per epoch; NaN where nothing was measured, no rows where there is no ``curve.csv``."""
    settings: tuple[str, ...] = ()
    """Of an ablation's training, under which settings tables show it; empty for a main one."""

    @property
    def setting(self) -> str:
        """What an ablation's training is, as in ``fusion=target``; empty for a main one."""
        return self.settings[0] if self.settings else ""


def read_trainings(folder: Path) -> list[Training]:
    """Read every ``facts.json`` under ``folder`` and the ``curve.csv`` beside it, if there is one.

    Those of ablations come last.

    Raises:
        ValueError: A file is cut short or not what it should be.
    """
    found = [_read_training(folder, file) for file in sorted(folder.glob(f"**/{FACTS}"))]
    return sorted(found, key=lambda one: one.setting != "")


def read_shipped(results: Path) -> list[Training]:
    """Read what ``shipped/<method>/<scenario>.json`` says of the training of weights that came along.

    Raises:
        ValueError: A file is cut short or not what it should be.
    """
    found = []
    for file in sorted(results.glob(f"{SHIPPED}/*/*.json")):
        facts, no_curve = _read_object(file), _read_curve(file.with_suffix(".curve"))
        found.append(Training(file.stem, file.parent.name, facts, no_curve, (SHIPPED,)))
    return found


def _read_training(folder: Path, file: Path) -> Training:
    budget, ablated = _read_object(file), file.is_relative_to(folder / ABLATIONS)
    scenario, method, settings = (budget.get(key) for key in ("scenario", "method", "settings"))
    if not isinstance(scenario, str) or not isinstance(method, str):
        raise ValueError(f"{file} needs the names of scenario, method, has {[scenario, method]}")
    if ablated != bool(settings) or not all(isinstance(one, str) for one in settings or []):
        raise ValueError(
            f"{file} needs the names of its settings if of an ablation, has {settings}"
        )
    curve = _read_curve(file.with_name(CURVE))
    return Training(scenario, method, budget, curve, tuple(settings or ()))


def _read_object(file: Path) -> dict[str, Any]:
    try:
        found = json.loads(file.read_text(encoding="utf-8"))
    except ValueError as error:
        raise ValueError(f"{file} needs a whole JSON object, got {error}") from None
    if not isinstance(found, dict):
        raise ValueError(f"{file} needs a JSON object, got a {type(found).__name__}")
    return found


def _read_curve(file: Path) -> pd.DataFrame:
    if not file.exists():
        return pd.DataFrame(columns=["epoch", "step", "loss"])
    header, rows = read_csv(file)
    missing = sorted({"epoch", "step", "loss"} - {*header})
    if missing:
        raise ValueError(f"{file} needs the columns {', '.join(missing)}, it lacks them")
    numbers = pd.DataFrame(rows, columns=header).apply(pd.to_numeric, errors="coerce")
    return numbers.replace([np.inf, -np.inf], np.nan)


@dataclass(frozen=True)
class PairFile:
    """What a report needs of a pair file, read once."""

    scenario: str
    source: str
    """Where the raw data came from: ``synthetic``, ``local``, ``download`` or ``unknown``."""
    unit: str
    """Of length."""
    seed: int
    schema: int
    provenance: dict[str, Any]
    test: Pairs


def read_pair_files(folder: Path, scenarios: Iterable[str]) -> dict[str, PairFile]:
    """Read what each ``<scenario>.h5`` says about itself, and its test pairs.

    Raises:
        FileNotFoundError: A scenario has no pair file.
        ValueError: A file is not a pair file.
    """
    return {name: _read_pair_file(folder / f"{name}.h5", name) for name in sorted({*scenarios})}


def _read_pair_file(path: Path, scenario: str) -> PairFile:
    attributes = read_attributes(path)
    return PairFile(
        scenario=scenario,
        source=str(attributes["provenance"].get("source", "unknown")),
        unit=str(attributes["unit"]),
        seed=int(attributes["seed"]),
        schema=int(attributes["schema"]),
        provenance=attributes["provenance"],
        test=read_pairs(path, "test"),
    )
