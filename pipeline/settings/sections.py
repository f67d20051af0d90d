"""What the sections of params.yaml are made of."""

import re
from collections import Counter
from typing import Annotated, Literal, TypeVar

from pydantic import AfterValidator, BaseModel, ConfigDict, Field

Fraction = Annotated[float, Field(ge=0, lt=1)]
Positive = Annotated[float, Field(gt=0, le=1e9)]
Length = Annotated[float, Field(ge=0, le=1e9)]
Count = Annotated[int, Field(ge=1, le=10**9)]
MultipleOfFour = Annotated[int, Field(ge=4, multiple_of=4, le=10**9)]
Workers = Annotated[int, Field(ge=1, le=10_000)]
"""Processes, threads or hosts. No bound is near what is of use, nor near what overflows."""
Normals = Literal["given", "estimated"]
"""The data set's own, clean, or read off the points that a method is given."""
Representation = Literal["quaternion", "euler", "rotation_6d", "twist", "dual_quaternion", "matrix"]
Scaling = Literal["raw", "standardised"]
Fusion = Literal["source", "target", "concat"]
WithOrWithout = Literal["with", "without"]
"""These four are the library's own names; written again here, since it takes seconds to import."""
Sampler = Literal["ddpm", "ddim", "feedback"]
SearchPrecision = Literal["float32", "bfloat16", "auto"]
"""Precision of the search for PointNet's maxima; see ``pcrdiff.geometry.precision``."""
SettingName = Literal[
    "paper", "official", "one_step", "four_steps", "refined_one_step", "refined", "thorough"
]
"""The paper's iteration counts, the authors' own settings, steps of a walk that sees the pose, or
starts, few or many, that are refined and verified."""


def _check_name(name: str) -> str:
    """Names are parts of paths, of commands, of DVC's keys and of its stages."""
    if not re.fullmatch(r"(?=.*[A-Za-z])[A-Za-z0-9][A-Za-z0-9_-]{0,63}", name):
        rule = "1 to 64 of A-Z, a-z, 0-9, _ and -, a letter among them, the first no _ or -"
        raise ValueError(f"a name needs {rule}")
    return name


Name = Annotated[str, AfterValidator(_check_name)]
"""The name of a data set or a scenario."""


T = TypeVar("T")


def _check_distinct(values: list[T]) -> list[T]:
    """DVC makes one stage of two equal entries; a stage that goes over a list would do both."""
    doubled = [value for value, times in Counter(values).items() if times > 1]
    if doubled:
        raise ValueError(f"a list needs each of its entries once, has {doubled[0]!r} again")
    return values


Distinct = Annotated[list[T], AfterValidator(_check_distinct)]
Listed = Annotated[list[T], Field(min_length=1), AfterValidator(_check_distinct)]


class Section(BaseModel):
    """A part of params.yaml; an unknown, missing or ill-typed key is refused."""

    model_config = ConfigDict(extra="forbid", frozen=True, strict=True, allow_inf_nan=False)
