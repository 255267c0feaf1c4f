"""Effects in a model file: which, and the numbers of its law. What codes and names there are, the mechanics know."""

from __future__ import annotations

from typing import Any

from pydantic import Field, field_validator

from robots.schema.quantities import Scalar, Strict


class EffectNumber(Scalar):
    """A number of an effect's law; whether its unit fits is checked where the law is known (:mod:`fem.effects`)."""


class EffectTable(Strict):
    """An effect that the arm has: ``code`` names family and place (``backlash:j2``), ``parameters`` its numbers.

    An amplitude that is not given is zero: nothing of it acts.
    """

    code: str = Field(min_length=1)
    parameters: dict[str, EffectNumber] = Field(default_factory=dict)
    note: str | None = None

    @field_validator("code", mode="before")
    @classmethod
    def _text(cls, code: Any) -> Any:
        if isinstance(code, str) and code != code.strip():
            raise ValueError("must not begin or end with a blank")
        return code
