"""The page that follows a run through the code names functions that a run executes."""

import inspect
import re
import sys
from pathlib import Path
from pkgutil import resolve_name

from shipped import config_path

import beamsim
from beamsim.cli.motions import run_screen
from beamsim.plots.run import run_figures
from beamsim.store.results import write_result

PAGE = Path(__file__).parents[2] / "docs" / "from_yaml_to_picture.md"
COMMAND = {"cli.app.run", "cli.command.run_analysis"}  # not executed by what follows


def named_functions():
    """Names in the first column of the tables, and those of functions in the second."""
    names = re.findall(r"`((?:\w+\.){2,}\w+)`", PAGE.read_text(encoding="utf-8"))
    return {name for name in names if (Path(beamsim.__file__).parent / name.split(".")[0]).is_dir()}


def test_functions_of_the_page_are_executed_by_a_run(tmp_path):
    executed = set()

    def note(frame, event, _):
        if event == "call" and "beamsim" in frame.f_code.co_filename:
            executed.add(frame.f_code)

    for name in named_functions():
        getattr(resolve_name(f"beamsim.{name}"), "cache_clear", lambda: None)()  # of what other tests computed
    sys.setprofile(note)
    try:
        scenario = beamsim.load_scenario(config_path("one_sided_65hz"))
        result = beamsim.run(scenario)
        write_result(result, tmp_path / "case.h5")
        run_figures(result)
        run_screen(result)
    finally:
        sys.setprofile(None)
    for name in named_functions():
        function = inspect.unwrap(resolve_name(f"beamsim.{name}"))
        code = getattr(function, "__func__", function).__code__
        assert code in executed or name in COMMAND, name
    assert len(named_functions()) > 20
