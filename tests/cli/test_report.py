"""`beamsim report` and `beamsim animate`: files that hold everything they show, tried in a browser."""

import gzip
import importlib.util
import json
import re
import shutil
import subprocess
from functools import cache
from html import unescape
from pathlib import Path

import h5py
import numpy as np
import pytest
from PIL import Image
from sampling import first_apart

import beamsim
from beamsim.errors import MethodError
from beamsim.files import seal
from beamsim.report import page
from tests.helpers.commands import invoke

STORED = Path(__file__).parents[1] / "data" / "results"
KINDS = [
    "run_chain", "run_random", "sweep", "continuation", "designs", "identify_update", "nnm", "compare", "compare_modes",
]  # fmt: skip
PROGRAMS = ("chromium", "chromium-browser", "google-chrome", "google-chrome-stable", "chrome", "msedge")
LARGEST = 6_000_000  # bytes
BROWSER = next(filter(None, map(shutil.which, PROGRAMS)), None)
needs_browser = pytest.mark.skipif(BROWSER is None, reason="no Chromium or Chrome is installed")

# Runs after the page's own script: zooms the first plot as a user would, hides a curve, and stops the animation.
TRIAL = """<script>
window.seen = [];
window.addEventListener("error", event => seen.push(String(event.message)));
window.addEventListener("unhandledrejection", event => seen.push(String(event.reason)));
const complain = console.error; console.error = (...what) => { seen.push(what.join(" ")); complain(...what); };
(async function () {
  while (document.body.dataset.drawn === undefined) await new Promise(done => setTimeout(done, 50));
  const said = { drawn: +document.body.dataset.drawn, errors: seen, hit: window.hit === undefined ? 0 : window.hit };
  said.data = document.getElementById("data").textContent;
  said.title = document.title;
  const loaded = performance.getEntriesByType("resource").map(each => each.name);
  said.fetched = loaded.filter(name => !/^(data|blob):/.test(name));
  const plot = document.getElementById("plot-0");
  if (plot) {
    const before = plot.layout.xaxis.range.slice();
    const area = plot.querySelector(".nsewdrag").getBoundingClientRect(), y = area.top + area.height / 2;
    const at = share => ({ clientX: area.left + share * area.width, clientY: y, bubbles: true, button: 0, buttons: 1 });
    plot.querySelector(".nsewdrag").dispatchEvent(new MouseEvent("mousedown", at(0.25)));
    document.dispatchEvent(new MouseEvent("mousemove", at(0.5)));
    document.dispatchEvent(new MouseEvent("mouseup", at(0.5)));
    await new Promise(done => setTimeout(done, 600));
    said.before = before; said.after = plot.layout.xaxis.range.slice();
    said.curves = plot.querySelectorAll(".scatterlayer .trace, .heatmaplayer .hm").length;
    await Plotly.restyle(plot, { visible: "legendonly" }, [0]);
    said.left = plot.querySelectorAll(".scatterlayer .trace, .heatmaplayer .hm").length;
  }
  const canvas = document.getElementById("animation");
  if (canvas) {
    const position = document.getElementById("position"), first = canvas.toDataURL();
    position.value = Math.floor(position.max / 2); position.dispatchEvent(new Event("input"));
    said.moved = canvas.toDataURL() !== first; said.button = document.getElementById("play").textContent;
  }
  const text = document.createElement("output"); text.id = "trial"; text.textContent = JSON.stringify(said);
  document.body.append(text);
})();
</script>"""


def stored(name, folder):
    target = folder / f"{name}.h5"
    target.write_bytes(gzip.decompress((STORED / f"{name}.h5.gz").read_bytes()))
    return target


@pytest.fixture(scope="module")
def reported(tmp_path_factory):
    """Gives the report of a kept result, which is made once."""

    @cache
    def by_name(name):
        folder = tmp_path_factory.mktemp(name)
        done = invoke("report", stored(name, folder), "-o", folder, "--json")
        assert done.exit_code == 0, done.output
        (file,) = json.loads(done.stdout)["files"]
        return Path(file)

    return by_name


def tried(file, tmp_path):
    """What the trial saw in the browser."""
    tried = tmp_path / "tried.html"
    text = file.read_text(encoding="utf-8")
    tried.write_text(text.replace("</body>", TRIAL + "</body>"), encoding="utf-8")
    command = [
        BROWSER, "--headless=new", "--disable-gpu", "--no-first-run", "--disable-extensions", "--disable-dev-shm-usage",
        "--disable-background-networking", f"--user-data-dir={tmp_path / 'profile'}", "--no-sandbox",
        "--window-size=1100,1600", "--virtual-time-budget=30000", "--dump-dom", tried.as_uri(),
    ]  # fmt: skip
    done = subprocess.run(command, capture_output=True, text=True, timeout=180, check=True)
    return json.loads(unescape(re.search(r'<output id="trial">(.*?)</output>', done.stdout, re.S)[1]))


@first_apart("name", 5, KINDS)
def test_every_kind_of_result_has_a_report_in_one_file(name, reported):
    text = reported(name).read_text(encoding="utf-8")
    assert len(text.encode()) < LARGEST
    # nothing is fetched: addresses are within the page or hold their data
    outside = [
        each for each in re.findall(r'(?:src|href)="([^"]*)"', text) if not each.startswith(("#", "data:"))
    ]  # fmt: skip
    assert not outside
    assert "@import" not in text.split("</style>")[0]
    assert "url(" not in text.split("</style>")[0]
    front, appendix = text.split('<h1 class="appendix">Appendix</h1>')
    assert re.findall(r"<h2>(.*?)</h2>", front)[-2:] == ["Summary", "How sure"]
    assert {"Question", "Model"} <= set(re.findall(r"<h2>(.*?)</h2>", front))
    assert front.split("<h2>Summary</h2>")[1].count("<img") in (1, 2, 3)
    headings = re.findall(r"<h2>(.*?)</h2>", appendix)
    assert {"Model in numbers", "Results", "Plots", "Why these numbers can be trusted", "Scenario"} <= set(headings)
    spoken = re.sub(r"<pre>.*?</pre>|<[^>]*>", "", text.split("</nav>")[1].split("<script")[0], flags=re.S)
    assert not re.search(r"[{}]", spoken)  # no dictionary of Python
    data = json.loads(re.search(r'id="data">(.*?)</script>', text, re.S)[1])
    assert data["plots"]
    assert all(plot["data"] for plot in data["plots"])
    assert ("Motion" in headings) == (data["animation"] is not None) == name.startswith(("run", "nnm"))


@pytest.mark.parametrize(("name", "said"), [("sweep", "swept sine"), ("continuation", "steady sine")])
def test_the_excitation_of_a_sweep_is_a_sweep(name, said, reported):
    text = reported(name).read_text(encoding="utf-8")
    (excitation,) = re.findall(r'excitation</td><td class="text">(.*?)</td>', text)
    assert excitation.startswith(said)
    assert " to " in excitation
    assert "harmonic" not in excitation


def test_a_caption_is_no_file_name():
    for name, words in (("srs", "Shock response spectra"), ("contact_force", "Contact force")):
        assert f"<figcaption>{words}</figcaption>" in page.caption_plot(name, "")


def test_the_verdict_names_the_limit_that_is_exceeded(reported):
    text = reported("continuation").read_text(encoding="utf-8")
    assert '<div class="verdict bad"><strong>Limit exceeded: gap</strong>' in text
    assert "bad-cell" in text


@needs_browser
@pytest.mark.parametrize("name", ["run_random", "designs", "nnm"])
def test_plots_and_animation_react_in_a_browser_without_errors(name, reported, tmp_path):
    said = tried(reported(name), tmp_path)
    assert said["errors"] == []
    assert said["drawn"] > 0
    width = [abs(said[when][1] - said[when][0]) for when in ("before", "after")]
    assert width[1] == pytest.approx(0.25 * width[0], rel=0.05)
    assert said["left"] == said["curves"] - 1
    if name != "designs":
        assert said["moved"]
        assert said["button"] == "Play"


HOSTILE = (
    "</script><script>window.hit=1</script>", "<!--<script>", "]]>",
    "\"><img src=http://hostile.invalid/a onerror=hit=2>",
    "' onload='hit=3", "javascript:window.hit=4", "<svg/onload=hit=5>", "&lt;b&gt;", "${hit=6}", "%{x}<extra>",
)  # fmt: skip
UNSEEN = ("\x1b[31mred\x1b[0m", "\x07\x9b2J", "\u202egpj.exe", "\u2066left", "\u2028line")


def hostile_report(folder):
    """The report of a run whose title and file name are hostile, and which was edited to hold what no case may."""
    case = {
        "title": " ".join(HOSTILE),
        "chain": {"masses": [1.0, 1.0], "springs": [1.0, 1.0], "dashpots": [0.05, 0.05],
                  "snubbers": [{"name": "stop", "mass": 1, "side": "above", "stiffness": 5.0, "gap": 0.2}]},
        "excitation": {"kind": "harmonic", "applied_to": "base", "level": 0.4, "frequency": 0.1},
        "probes": [{"name": "one", "mass": 1}],
        "run": {"duration": 30.0, "sample_rate": 5.0, "convergence": "off"},
    }  # fmt: skip
    path = beamsim.write_result(beamsim.run(beamsim.load_scenario(case)), folder / "<script>hit=7 '\u202e<!--.h5")
    with h5py.File(path, "r+") as file:
        file.attrs["warnings"] = json.dumps([*HOSTILE, *UNSEEN])
        file.attrs["created"] = "".join(UNSEEN) + HOSTILE[0]
    seal(path)
    done = invoke("report", path, "-o", folder / "hostile.html", "--json")
    assert done.exit_code == 0, done.output
    return folder / "hostile.html"


@needs_browser
def test_hostile_texts_run_no_script_and_fetch_nothing(tmp_path):
    file = hostile_report(tmp_path)
    text = file.read_text(encoding="utf-8")
    assert not any(sign in text for each in UNSEEN for sign in each if not sign.isprintable())
    said = tried(file, tmp_path)
    assert said["errors"] == []
    assert said["hit"] == 0
    assert said["fetched"] == []
    assert said["drawn"] > 0
    assert said["title"] == " ".join(HOSTILE)
    data = json.loads(said["data"])
    assert data == json.loads(re.search(r'id="data">(.*?)</script>', text, re.S)[1])
    assert data["animation"]["title"] == " ".join(HOSTILE)


@needs_browser
def test_a_script_that_runs_and_a_picture_that_is_fetched_are_noticed(reported, tmp_path):
    file, text = tmp_path / "changed.html", reported("run_chain").read_text(encoding="utf-8")
    file.write_text(text.replace("<main>", "<main><script>window.hit=1</script>"), encoding="utf-8")
    assert tried(file, tmp_path)["hit"] == 1
    fetched = text.replace(page.POLICY, "").replace("<main>", '<main><img src="http://hostile.invalid/a">')
    file.write_text(fetched, encoding="utf-8")
    assert "http://hostile.invalid/a" in tried(file, tmp_path)["fetched"]


@needs_browser
def test_a_broken_script_is_noticed(reported, tmp_path):
    file, text = tmp_path / "changed.html", reported("run_chain").read_text(encoding="utf-8")
    file.write_text(text.replace("for (const [place", 'console.error("broken"); for (const [place'), encoding="utf-8")
    assert "broken" in " ".join(tried(file, tmp_path)["errors"])


def test_a_missing_library_is_an_error_with_a_remedy(tmp_path, monkeypatch):
    file = stored("run_chain", tmp_path)
    page.plotly.cache_clear()
    with monkeypatch.context() as patched:
        patched.setattr(page, "find_spec", lambda name: None)
        with pytest.raises(MethodError, match="beamsim\\[report\\]"):
            page.plotly()
        assert invoke("report", file, "-o", tmp_path).exit_code == 2
    assert importlib.util.find_spec("plotly") is not None
    assert not list(tmp_path.glob("*.html"))


def test_animation_as_gif_and_page(tmp_path):
    done = invoke("animate", stored("run_chain", tmp_path), "-o", tmp_path, "--json")
    assert done.exit_code == 0, done.output
    gif, html = map(Path, json.loads(done.stdout)["files"])
    with Image.open(gif) as picture:
        assert picture.n_frames > 100
        pixels = []
        for number in (0, picture.n_frames // 2):
            picture.seek(number)
            pixels.append(np.asarray(picture.convert("RGB")))
    assert np.any(pixels[0] != pixels[1])
    assert "<canvas" in html.read_text(encoding="utf-8")
    without = invoke("animate", stored("compare", tmp_path), "-o", tmp_path)
    assert without.exit_code == 2
    assert "holds no motion" in without.output
