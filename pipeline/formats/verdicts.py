"""The verdicts of a method on one scenario, by setting, as JSON."""

from collections.abc import Mapping
from dataclasses import asdict
from pathlib import Path

from pydantic import BaseModel, ConfigDict, ValidationError

from pcrdiff.registration import EVIDENCE
from pcrdiff.verdict import Verdict
from pipeline.formats.files import write_json

VERDICTS = "verdicts"
"""The folder of these files beside the answers: ``<method>/verdicts/<scenario>.json``."""


class _File(BaseModel):
    """What such a file holds."""

    model_config = ConfigDict(extra="forbid", allow_inf_nan=False)
    evidence: tuple[str, ...]
    settings: dict[str, Verdict]


def write_verdicts(path: Path, verdicts: Mapping[str, Verdict]) -> None:
    """Write the verdict of each setting, and the names of the evidence that it weighs."""
    settings = {name: asdict(verdict) for name, verdict in verdicts.items()}
    write_json(path, {"evidence": EVIDENCE, "settings": settings})


def read_verdicts(path: Path) -> dict[str, Verdict]:
    """Read the verdict of each setting.

    Raises:
        FileNotFoundError: There is no such file.
        ValueError: It is cut short, or holds something else than verdicts on ``EVIDENCE``.
    """
    if not path.is_file():
        raise FileNotFoundError(f"verdicts are needed at {path}, there are none")
    try:
        file = _File.model_validate_json(path.read_bytes())
    except ValidationError as error:
        first = error.errors()[0]
        where = ".".join(map(str, first["loc"])) or "the file"
        raise ValueError(f"{path} needs verdicts, {where} is none: {first['msg']}") from None
    for verdict in file.settings.values():
        counts = [len(part) for part in (verdict.mean, verdict.scale, verdict.coefficients)]
        if file.evidence != EVIDENCE or counts != [len(EVIDENCE)] * 3:
            raise ValueError(f"{path} needs verdicts on {', '.join(EVIDENCE)}, has others")
    return file.settings
