"""What all tables of a scenario share: frozen, no unknown keys, bounded numbers. No key is defined here."""

from typing import Annotated

from pydantic import BaseModel, ConfigDict, Field

Positive = Annotated[float, Field(gt=0, allow_inf_nan=False)]
NonNegative = Annotated[float, Field(ge=0, allow_inf_nan=False)]
Finite = Annotated[float, Field(allow_inf_nan=False)]


class Section(BaseModel):
    """The base of every table of a scenario file."""

    model_config = ConfigDict(frozen=True, extra="forbid", validate_default=True)
