"""Screens say what their files hold: the reader of sentences finds planted ones that do not.

That the screens of the shipped configs are without any is in test_configs.py and test_design_configs.py.
"""

import gzip
from pathlib import Path
from pkgutil import resolve_name

import pytest
import yaml
from sampling import first_apart

from beamsim.kinds import KINDS
from beamsim.plots.style import use_units
from beamsim.store.results import kind_of, load
from tests.helpers.commands import invoke
from tests.helpers.screens import ResultFacts
from tests.helpers.sentences import contradictions

STORED = Path(__file__).parents[1] / "data" / "results"
CASE = {
    "title": "A beam with a stop",
    "beam": {"length": 0.27, "bending_stiffness": 2.0, "mass_per_length": 0.25,
             "damping": {"kind": "modal", "ratio": 0.05}},
    "snubbers": [{"name": "tip", "position": 0.27, "side": "below", "stiffness": "10 kN/m", "gap": "0.1 mm"}],
    "probes": [{"name": "middle", "position": 0.135}],
    "excitation": {"kind": "harmonic", "applied_to": "base", "level": "2 g", "frequency": "60 Hz"},
    "limits": {"peak_force": "1 N", "peak_displacement": "5 mm"},
    "run": {"duration": 0.1, "spectrum": {"last": 0.05}},
}  # fmt: skip
ONE_MODE = {"reduction": {"modes": 1}, "snubbers": [CASE["snubbers"][0] | {"stiffness": "1000 kN/m"}]}
NOTCHED = {
    "chain": {"masses": ["1 kg"], "springs": ["10 kN/m"], "damping": {"kind": "modal", "ratio": "2 %"}},
    "snubbers": [{"name": "pad", "mass": 1, "side": "above", "stiffness": "20 kN/m", "preload": "10 N"}],
    "excitation": {"kind": "harmonic", "applied_to": "base", "level": "0.5 g", "frequency": "20 Hz"},
    "sweep": {"kind": "swept_sine", "from": "20 Hz", "to": "35 Hz", "rate": "30 oct/min",
              "notches": [{"from": "24 Hz", "to": "32 Hz", "level": "0.02 g"}]},
}  # fmt: skip
RANDOM = {
    "chain": {"masses": ["1 kg"], "springs": ["10 kN/m"], "damping": {"kind": "modal", "ratio": "2 %"}},
    "excitation": {"kind": "random", "applied_to": "base", "seed": 1,
                   "psd": [{"frequency": f, "density": "0.01 g^2/Hz"} for f in ("5 Hz", "100 Hz")]},
    "run": {"duration": "20 s", "test_duration": "2 min", "sample_rate": "500 Hz", "convergence": "off"},
    "limits": {"peak_displacement": "9 mm"},
}  # fmt: skip
SHAPED = NOTCHED | {
    "sweep": {"kind": "swept_sine", "from": "20 Hz", "to": "35 Hz", "rate": "60 oct/min", "levels": [0.5, 1.0],
              "convergence": "off",
              "profile": [{"frequency": "20 Hz", "level": "0.5 g"}, {"frequency": "30 Hz", "level": "0.1 g"}]},
    "limits": {"peak_displacement": "1 mm"},
}  # fmt: skip
WORN = CASE | {
    "beam": {"length": 0.27, "width": 0.05, "thickness": 0.005, "youngs_modulus": 69e9, "density": 2700.0,
             "damping": {"kind": "modal", "ratio": 0.05}},
    "run": {"duration": 0.1, "convergence": "off",
            "fatigue": {"stress_range": "80 MPa", "cycles": 2e6, "exponent": 5}},
}  # fmt: skip


@pytest.fixture(scope="module")
def screen_of(tmp_path_factory):
    """Screen and file of a case by name, each computed once; of a stored result what is printed of it."""
    folder, known = tmp_path_factory.mktemp("screens"), {}
    cases = {
        "beam": ("run", CASE),
        "one mode": ("run", CASE | ONE_MODE),
        "notched": ("sweep", NOTCHED),
        "random": ("run", RANDOM),
        "shaped": ("sweep", SHAPED),
        "worn": ("run", WORN),
    }

    def computed(name):
        if name not in known:
            path = folder / f"{name}.h5"
            if name in cases:
                command, case = cases[name]
                (folder / "case.yaml").write_text(yaml.safe_dump(case), encoding="utf-8")
                done = invoke(command, folder / "case.yaml", "--no-plots", "-o", path)
                known[name] = done.stdout, command, path
            else:
                path.write_bytes(gzip.decompress((STORED / f"{name}.h5.gz").read_bytes()))
                result, kind = load(path), KINDS[kind_of(path)]
                with use_units(result.scenario.display_scales):
                    known[name] = resolve_name(kind.screen)(result).text(result, [path.name]), kind.command, path
        text, command, path = known[name]
        return text, ResultFacts(path, command)

    return computed


NAMES = ("beam", "one mode", "notched", "random", "shaped", "worn", "coexisting", "continuation", "folds", "nnm",
         "designs", "designs_zip", "identify_nonlinear", "identify_snubber", "identify_update", "run_chain",
         "run_random", "run_springs", "stepped", "sweep")  # fmt: skip


@first_apart("name", 9, NAMES)
def test_screens_say_what_their_files_hold(name, screen_of):
    assert contradictions(*screen_of(name)) == []


PLANTED = {
    "a verdict that is inverted": ("beam", "peak force EXCEEDED", "peak force ok"),
    "the other way": ("beam", "peak displacement ok", "peak displacement EXCEEDED"),
    "a margin of another sign": ("beam", "margin -", "margin +"),
    "a count that is off by one": ("folds", "3 folds at 0.104", "4 folds at 0.104"),
    "contacts that are off by one": ("beam", " %, 4", " %, 5"),
    "stable points that are off by one": ("folds", "62 of 123 points", "63 of 123 points"),
    "cases that are off by one": ("designs", "1 of 4 cases compared", "2 of 4 cases compared"),
    "notes that are off by one": ("notched", "1 note (", "2 notes ("),
    "a wrong unit": ("beam", " mm ", " µm "),
    "a wrong unit of a stiffness": ("identify_snubber", "153.6 kN/m", "153.6 N/m"),
    "a lowest level that is not the lowest": ("notched", "pad opens from 0.035", "pad opens from 0.375"),
    "a place that is not that of the largest": ("stepped", " at 0.1 Hz", " at 0.09 Hz"),
    "a remedy that names a missing key": ("one mode", "run.low_pass", "run.lowpass"),
    "a remedy of another command": ("one mode", "run.low_pass", "sweep.levels"),
    "a kind that does not exist": ("folds", "kind: coexisting", "kind: coexist"),
    "complete beside what is not": ("one mode", "NOT CONVERGED: ", "NOT CONVERGED, complete: "),
    "converged above the tolerance": ("beam", "converged within ", "converged within 5"),
    "converged beside NOT CONVERGED": ("one mode", "NOT CONVERGED", "converged within 1 %"),
    "a count of doubtful values": ("one mode", "NOT CONVERGED: ", "NOT CONVERGED: 1"),
    "a mark that is missing": ("one mode", " *   ", "     "),
    "a first mode that is another": ("beam", "21.7 Hz open", "81.6 Hz open"),
    "a level that is not the case's": ("beam", "harmonic, 2 g", "harmonic, 3 g"),
    "another kind of excitation": ("beam", "harmonic, ", "random, "),
    "a jump of another size": ("shaped", " (-14.0 dB)", " (-13.8 dB)"),
    "a jump elsewhere": ("shaped", "jumps at 30 Hz", "jumps at 31 Hz"),
    "sweeps beyond a limit that are off by one": ("shaped", "in 2 of 2 sweeps", "in 1 of 2 sweeps"),
    "a life that is not the damage's": ("worn", ", life ", ", life 1"),
    "damage in another time": ("worn", " in 100 ms, life", " in 200 ms, life"),
    "damage elsewhere": ("worn", ", at x = 0\n", ", at x = 10 mm\n"),
    "an order that does not hold": ("random", "largest in 2 min", "largest in 2 s"),
    "a statistic that is another": ("random", "upper end of the 95 % interval", "median"),
    "all stable where some are not": ("folds", "62 of 123 points", "all"),
    "a sentence without a rule": ("beam", "\ntip touches", "\nthe stop is fine\ntip touches"),
    "a part of the verdict without a rule": ("beam", "converged within", "very good, converged within"),
    "a column without a rule": ("beam", "peak force   ", "peak farce   "),
}  # fmt: skip


@pytest.mark.parametrize("what", PLANTED)
def test_a_planted_sentence_is_found(what, screen_of):
    name, right, wrong = PLANTED[what]
    text, facts = screen_of(name)
    assert right in text, text
    assert contradictions(text.replace(right, wrong, 1), facts) != []


def test_an_interval_that_does_not_hold_its_value_is_found(screen_of):
    """Also where screen and file agree."""
    text, facts = screen_of("identify_snubber")
    facts.summary["interval_n_per_m"] = [156000.0, 158800.0]
    found = contradictions(text.replace("148.7 to 158.8 kN/m", "156.0 to 158.8 kN/m"), facts)
    assert [each for each in found if "the interval does not hold its value" in each], found


def test_a_largest_value_below_what_was_reached_is_found(screen_of):
    """Also where screen and file agree."""
    text, facts = screen_of("random")
    (displacement,) = (facts.summary["peak_displacement_m"],)
    displacement.update(dict.fromkeys(displacement, 1.0))
    assert [each for each in contradictions(text, facts) if "the run reached 1" in each]


def test_a_peak_below_its_history_is_found(screen_of):
    """Also where screen and file agree."""
    text, facts = screen_of("beam")
    facts.data["histories/snubber_force"] = 1.01 * facts.data["histories/snubber_force"]
    facts.data["histories/snubber_force"][0, 7] = 1e3
    assert [each for each in contradictions(text, facts) if "the history of tip reaches" in each]
