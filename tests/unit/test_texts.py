"""Texts that cannot be drawn, stored or printed, and surroundings in which a command cannot work as usual."""

import json
import os
import subprocess
import sys
from xml.etree import ElementTree

import numpy as np
import pytest
from PIL import Image

from beamsim.cli.session import print_json
from beamsim.errors import ResultFileError, ScenarioError
from beamsim.files import check_writable
from beamsim.plots.drawing import Chart, Curve, Picture, write
from beamsim.scenario import load_scenario, template


def titled(title):
    return load_scenario(template(), {"title": title}).title


@pytest.mark.parametrize(
    "text", ["\ud800", "a\0b", "\x1b[31mred", "bell\x07", "\ufffe", "a\x7f", "\x9b2J", "x" * 10_000]
)
def test_unprintable_text_is_refused(text):
    with pytest.raises(ScenarioError, match=r"title .*(U\+|10000 characters)"):
        titled(text)


@pytest.mark.parametrize(
    ("text", "line"),
    [
        ("two\nlines\n", "two lines"),
        ("a\tb", "a b"),
        ("a\u2028b", "a b"),
        ("Größe 試験 שלום 👩‍🚀", "Größe 試験 שלום 👩‍🚀"),
        ("$\\frac{1}{$", "$\\frac{1}{$"),
    ],
)
def test_text_is_one_line(text, line):
    assert titled(text) == line


def test_titles_are_never_mathematics(tmp_path):
    x, texts = np.geomspace(1e-7, 1e7, 9), ("cost $\\frac{1}{$", "a\\$b$c", "$x$", "Größe 👩‍🚀 試験", "x^2^")
    charts = [Chart((t, "s"), (t, "N"), [Curve(t, x, x)], log="xy", title=t, note=t, legend=t) for t in texts]
    write(Picture(texts[0], charts), tmp_path / "drawn.svg", "svg")
    drawn = (tmp_path / "drawn.svg").read_text(encoding="utf-8")
    for text in texts:
        assert f"<!-- {text[:4]}" in drawn  # the backend names the text that it draws
    assert "mathdefault" not in drawn
    assert "<!-- 10⁻⁶ -->" in drawn


def test_control_characters_are_drawn_as_escapes(tmp_path):
    x, text = np.arange(3.0), "a\x1b[31m\x00b c\x9b\u202ed ]]> --> <!-- & <script> e\x0c\ud800\ufffef"
    chart = Chart((text, "s"), (text, "N"), [Curve(text, x, x)], title=text, note=text, legend=text)
    for form in ("svg", "png", "pdf"):
        write(Picture(text, [chart]), tmp_path / f"drawn.{form}", form)
    tree = ElementTree.parse(tmp_path / "drawn.svg")  # well-formed
    assert not list(tree.iter("{http://www.w3.org/2000/svg}script"))
    drawn = (tmp_path / "drawn.svg").read_text(encoding="utf-8")
    assert all(sign.isprintable() or sign == "\n" for sign in drawn)
    with Image.open(tmp_path / "drawn.png") as picture:
        assert np.asarray(picture).min() < 128


def test_a_long_title_leaves_room_for_the_curves(tmp_path):
    chart = Chart(("Time", "s"), ("Force", "N"), [Curve("tip", np.arange(3.0), np.arange(3.0))])
    write(Picture("long title " * 90, [chart]), tmp_path / "drawn.svg", "svg")
    assert " …" in (tmp_path / "drawn.svg").read_text(encoding="utf-8")


def test_json_for_an_ascii_terminal(monkeypatch, tmp_path):
    with open(tmp_path / "out", "w", encoding="ascii", errors="backslashreplace") as stream:
        monkeypatch.setattr(sys, "stdout", stream)
        print_json({"title": "Größe \ud800"})
    assert json.loads((tmp_path / "out").read_text()) == {"title": "Größe \ud800"}


def test_output_path_that_no_file_can_have(tmp_path):
    (tmp_path / "loop.h5").symlink_to("loop.h5")
    for path in (tmp_path / "loop.h5", tmp_path / "loop.h5" / "x.h5", tmp_path / "a\0.h5", tmp_path / "\ud800.h5"):
        with pytest.raises(ResultFileError, match="cannot write"):
            check_writable(path)


@pytest.mark.parametrize("text", ["a: [" + "1," * 3_000 + "]\n", "- 1\n" * 3_000])
def test_yaml_of_too_many_values(text, monkeypatch):
    monkeypatch.setattr("beamsim.scenario.tree.MOST_VALUES", 2_500)
    with pytest.raises(ScenarioError, match="has more than 2500 keys and values; keep measured data in files"):
        load_scenario(text)


@pytest.mark.skipif(sys.platform == "win32", reason="commands of a shell")
@pytest.mark.parametrize(
    ("before", "after", "code", "says"),
    [
        ("export MPLBACKEND=foo;", "<&- >&- 2>&-", 0, ""),
        ("mkdir lost; cd lost; rmdir ../lost;", "", 2, "the current folder cannot be used"),
        ("ulimit -v 500000;", "", 2, "ulimit -v 1000000"),
        ("export LC_ALL=C PYTHONIOENCODING=ascii PYTHONUTF8=0;", "", 0, ""),
    ],
)
def test_surroundings(before, after, code, says, tmp_path):
    case = tmp_path / "case.yaml"
    case.write_text("title: Größe\n" + template().replace("title:", "# title:", 1), encoding="utf-8")
    done = subprocess.run(
        f"{before} {sys.executable} -c 'from beamsim.cli import main; main()' validate {case} {after}",
        shell=True, cwd=tmp_path, capture_output=True, check=False, env=os.environ | {"PYTHONSAFEPATH": "1"},
    )  # fmt: skip
    assert done.returncode == code, done.stderr
    assert says in done.stderr.decode()
