"""Results as tables of pandas and trees of xarray, which users have who want them."""

from __future__ import annotations

import tempfile
from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING, Any

from beamsim.analyses.result import Result
from beamsim.store.export import export_result, export_target, is_folder
from beamsim.store.results import write_result
from beamsim.store.stored import kind_of

if TYPE_CHECKING:
    import pandas
    import xarray


def data_frames(result: Result) -> dict[str, pandas.DataFrame]:
    """Return the tables of the CSV export as data frames, by name; numbers are the same bits.

    Raises
    ------
    ImportError
        If pandas is not installed.
    """
    pd = _imported("pandas")
    with tempfile.TemporaryDirectory() as folder:
        path = write_result(result, Path(folder) / "result.h5")
        kind = kind_of(path)
        target = export_target(Path(folder), kind, "csv") if is_folder(kind, "csv") else Path(folder) / f"{kind}.csv"
        tables = [file for file in export_result(path, target, "csv") if file.suffix == ".csv"]
        exact = (
            {} if int(pd.__version__.split(".")[0]) >= 3 else {"float_precision": "round_trip"}
        )  # the default since 3
        return {file.stem: pd.read_csv(file, **exact) for file in tables}


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
