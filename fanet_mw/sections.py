"""What all tables of a scenario file have in common: frozen, no unknown keys, numbers with bounds."""

from typing import Annotated

from pydantic import BaseModel, ConfigDict, Field

from fanet_mw.units import MAX_NODES

Positive = Annotated[float, Field(gt=0, allow_inf_nan=False)]
NonNegative = Annotated[float, Field(ge=0, allow_inf_nan=False)]
Finite = Annotated[float, Field(allow_inf_nan=False)]
Id = Annotated[int, Field(ge=1, le=MAX_NODES)]


class Section(BaseModel):
    """The base of every table of a scenario file."""

    model_config = ConfigDict(frozen=True, extra="forbid", validate_default=True)
