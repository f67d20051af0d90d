"""What the sections of params.yaml are made of."""

from typing import Annotated, Literal

from pydantic import BaseModel, ConfigDict, Field

Fraction = Annotated[float, Field(ge=0, lt=1)]
Positive = Annotated[float, Field(gt=0)]
Count = Annotated[int, Field(ge=1)]
Normals = Literal["given", "estimated"]
"""The data set's own, clean, or read off the points that a method is given."""
Representation = Literal["quaternion", "euler", "rotation_6d", "twist", "dual_quaternion", "matrix"]
Scaling = Literal["raw", "standardised"]
Fusion = Literal["source", "target", "concat"]
WithOrWithout = Literal["with", "without"]
"""These four are the library's own names; written again here, since it takes seconds to import."""
Sampler = Literal["ddpm", "ddim"]
SearchPrecision = Literal["float32", "bfloat16", "auto"]
"""Of PointNet's maxima; ``pcrdiff.geometry.precision`` says what ``auto`` is."""
SettingName = Literal["paper", "official"]
"""The paper's iteration counts, or the authors' own settings."""


class Section(BaseModel):
    """A part of params.yaml; an unknown, missing or ill-typed key is refused."""

    model_config = ConfigDict(extra="forbid", frozen=True, strict=True)
