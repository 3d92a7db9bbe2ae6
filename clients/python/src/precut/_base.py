"""What every model is made of."""

from __future__ import annotations

from typing import Any, Generic, Literal, TypeVar, get_args, get_origin

from pydantic import BaseModel, ConfigDict

R = TypeVar("R")


class Base(BaseModel):
    """An object of the contract. Fields carry their units in their names; what a newer service adds is kept."""

    # Schemas are built when a class is first used: there are hundreds, and a program needs a few.
    # `from`, which Python keeps for itself, is `from_`.
    model_config = ConfigDict(
        extra="allow", defer_build=True, use_attribute_docstrings=True, validate_by_name=True, validate_by_alias=True
    )

    def model_post_init(self, context: Any, /) -> None:
        # A job is sent without what was left to its default. The word that tells choices apart has to go with it.
        for name, field in type(self).model_fields.items():
            if get_origin(field.annotation) is Literal and get_args(field.annotation) == (field.default,):
                self.__pydantic_fields_set__.add(name)

    def as_sent(self) -> dict[str, Any]:
        """As it is sent: what was said, not what was left to its default."""
        return self.model_dump(mode="json", by_alias=True, warnings=False, exclude_unset=True, exclude_none=True)


class Asks(Generic[R]):
    """A job, by what comes back: only for type checkers and editors."""
