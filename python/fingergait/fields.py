"""What the tables of every input file share: strictness, and the numbers they are made of."""

from typing import Annotated

from pydantic import BaseModel, ConfigDict, Field

Positive = Annotated[float, Field(gt=0.0)]
NonNegative = Annotated[float, Field(ge=0.0)]
Index = Annotated[int, Field(ge=0)]
Vector = tuple[float, float, float]
Twist = tuple[float, float, float, float, float, float]


class Table(BaseModel):
    """Base of the tables: unknown keys, NaN and infinity are refused."""

    model_config = ConfigDict(extra="forbid", allow_inf_nan=False, frozen=True)
