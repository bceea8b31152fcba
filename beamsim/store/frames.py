"""Results as tables of pandas and trees of xarray, which users have who want them."""

from __future__ import annotations

import tempfile
from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING, Any

from beamsim.analyses.result import Result
from beamsim.store.export import tables_of
from beamsim.store.flat import items_of
from beamsim.store.results import write_result

if TYPE_CHECKING:
    import pandas
    import xarray


def data_frames(result: Result) -> dict[str, pandas.DataFrame]:
    """Return the tables of the CSV export as data frames, by name.

    Raises
    ------
    ImportError
        If pandas is not installed.
    """
    pd = _imported("pandas")
    frames = {}
    for table in tables_of(items_of(result)):
        headers = [column.header for column in (*table.axes, *table.columns)]
        frames[table.name] = pd.DataFrame(dict(zip(headers, table.part(0, table.size), strict=True)))
    return frames


def data_tree(result: Result) -> xarray.DataTree:
    """Return the groups of the result file as a tree of datasets.

    Raises
    ------
    ImportError
        If xarray or h5netcdf is not installed.
    """
    xr = _imported("xarray")
    _imported("h5netcdf")
    with tempfile.TemporaryDirectory() as folder:
        path = write_result(result, Path(folder) / "result.h5")
        with xr.open_datatree(path, engine="h5netcdf", phony_dims="sort") as tree:
            return tree.load()  # type: ignore[no-any-return]


def _imported(name: str) -> Any:
    try:
        return import_module(name)
    except ImportError as error:
        raise ImportError(f"this needs {name}, which is not installed: pip install {name}") from error
