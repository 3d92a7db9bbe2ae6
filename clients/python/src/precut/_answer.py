"""An answer: what was computed, its tables, figures and program."""

from __future__ import annotations

from functools import cached_property
from html import escape
from pathlib import Path
from typing import TYPE_CHECKING, Any, Generic, TypeVar

from pydantic import TypeAdapter

from . import _flow as flow
from . import models
from ._base import R

if TYPE_CHECKING:
    import pandas

    from ._async import AsyncClient
    from ._sync import Client

T = TypeVar("T")


class Figure(str):
    """A drawing as SVG text; a notebook shows it."""

    def _repr_svg_(self) -> str:
        return str(self)

    def save(self, path: str | Path) -> None:
        Path(path).write_text(self, encoding="utf-8")


class Envelope(Generic[R]):
    """What every answer says."""

    def __init__(self, raw: dict[str, Any], result: Any = None) -> None:
        self.raw = raw
        """The answer as it came."""
        self._result = result

    @property
    def calculator(self) -> str:
        return self.raw["calculator"]

    @property
    def version(self) -> int:
        """Version of the calculator: rises when numbers of an unchanged job may change."""
        return self.raw["version"]

    @property
    def key(self) -> str:
        """Lasting address of the answer."""
        return self.raw["key"]

    @property
    def input(self) -> dict[str, Any]:
        """The job with all defaults."""
        return self.raw["input"]

    @cached_property
    def result(self) -> R:
        """The calculator's own result as a model."""
        of_result = self._result or result_of(self.calculator, self.input)
        return TypeAdapter(of_result).validate_python(self.raw["result"], extra="allow")

    @cached_property
    def explanation(self) -> list[models.Remark]:
        """What dominates and what would help, the most important first."""
        return TypeAdapter(list[models.Remark]).validate_python(self.raw["explanation"], extra="allow")

    @cached_property
    def warnings(self) -> list[models.Notice]:
        """Where an input leaves the range of a formula, and the like."""
        return TypeAdapter(list[models.Notice]).validate_python(self.raw["warnings"], extra="allow")

    @cached_property
    def basis(self) -> list[models.Basis]:
        """The equations that acted, with their sources."""
        return TypeAdapter(list[models.Basis]).validate_python(self.raw["basis"], extra="allow")

    def __repr__(self) -> str:
        said = "".join(f"\n  {remark.text}" for remark in self.explanation)
        warned = "".join(f"\n  warning: {notice.detail}" for notice in self.warnings)
        return f"<{self.calculator} {self.key[:11]}>{said}{warned}"

    def _repr_html_(self) -> str:
        items = [f"<li>{escape(remark.text)}</li>" for remark in self.explanation]
        items += [f"<li><b>{escape(notice.detail)}</b></li>" for notice in self.warnings]
        return f"<p><code>{escape(self.calculator)} {escape(self.key[:11])}</code></p><ul>{''.join(items)}</ul>"


def result_of(calculator: str, job: dict[str, Any]) -> Any:
    """The class of a result. That of a diagnosis depends on the calculator whose model is diagnosed."""
    choices = [(of_job, result) for of_job, (id, result) in models.JOBS.items() if id == calculator]
    for of_job, result in choices:
        field = of_job.model_fields.get("calculator")
        if len(choices) == 1 or (field is not None and field.default == job.get("calculator")):
            return result
    return dict[str, Any]


class Answer(Envelope[R]):
    """An answer. Its tables, figures and program are fetched when they are asked for."""

    def __init__(self, raw: dict[str, Any], client: Client, result: Any = None) -> None:
        super().__init__(raw, result)
        self._client = client

    def tables(self) -> dict[str, pandas.DataFrame]:
        """All tables by name."""
        return frames(self._client._run(lambda patience: flow.tables(self.key, patience)))

    def table(self, name: str | None = None) -> pandas.DataFrame:
        """One table, the first if none is named. Columns are called `name [unit]`."""
        return picked(self.tables(), name)

    def figure(self, name: str | None = None) -> Figure:
        """One figure, the first if none is named."""
        return Figure(self._form("image/svg+xml", figure=name))

    def csv(self, name: str | None = None) -> str:
        """One table as CSV text, the first if none is named."""
        return self._form("text/csv", table=name)

    def program(self) -> str:
        """The program for the machine, where a path is the answer."""
        return self._form("text/x-gcode")

    def _form(self, media_type: str, **query: str | None) -> str:
        return self._client._run(lambda patience: flow.form(self.key, media_type, query, patience))


class AsyncAnswer(Envelope[R]):
    """An answer. Its tables, figures and program are fetched when they are asked for."""

    def __init__(self, raw: dict[str, Any], client: AsyncClient, result: Any = None) -> None:
        super().__init__(raw, result)
        self._client = client

    async def tables(self) -> dict[str, pandas.DataFrame]:
        """All tables by name."""
        return frames(await self._client._run(lambda patience: flow.tables(self.key, patience)))

    async def table(self, name: str | None = None) -> pandas.DataFrame:
        """One table, the first if none is named. Columns are called `name [unit]`."""
        return picked(await self.tables(), name)

    async def figure(self, name: str | None = None) -> Figure:
        """One figure, the first if none is named."""
        return Figure(await self._form("image/svg+xml", figure=name))

    async def csv(self, name: str | None = None) -> str:
        """One table as CSV text, the first if none is named."""
        return await self._form("text/csv", table=name)

    async def program(self) -> str:
        """The program for the machine, where a path is the answer."""
        return await self._form("text/x-gcode")

    async def _form(self, media_type: str, **query: str | None) -> str:
        return await self._client._run(lambda patience: flow.form(self.key, media_type, query, patience))


def frames(found: list[models.ResultTable]) -> dict[str, pandas.DataFrame]:
    try:
        import pandas
    except ImportError as fault:
        raise ImportError("tables are DataFrames of pandas: pip install 'precut[tables]'") from fault
    made = {}
    for table in found:
        columns = {
            f"{column.name} [{column.unit}]" if column.unit else column.name: column.cells for column in table.columns
        }
        made[table.id] = pandas.DataFrame(columns)
    return made


def picked(tables: dict[str, T], name: str | None) -> T:
    if not tables:
        raise KeyError("this answer has no tables")
    if name is None:
        return next(iter(tables.values()))
    if name not in tables:
        raise KeyError(f"this answer has no table {name}; it has {', '.join(tables)}")
    return tables[name]
