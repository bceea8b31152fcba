"""A scenario written as YAML and read again is the same scenario; any input gives a scenario or located problems."""

import contextlib

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from beamsim.errors import ScenarioError
from beamsim.scenario import load_scenario, units
from beamsim.scenario.tree import parse

pytestmark = pytest.mark.quick

numbers = st.floats(1e-6, 1e6)
anything = st.floats(-1e6, 1e6).filter(lambda x: x == 0.0 or abs(x) > 1e-30)
ratios = st.floats(0.0, 0.5).map(lambda x: x if x > 1e-30 else 0.0)
frequencies = st.floats(1e-3, 1e4)
durations = st.floats(1e-2, 100.0)
names = st.from_regex(r"[A-Za-z_][A-Za-z0-9_-]{0,8}", fullmatch=True)


def problems(call):
    """The problems of a call, none if it succeeds; None for a refusal that names none. Anything else is raised."""
    try:
        call()
    except ScenarioError as error:
        return error.problems or None
    return ()


def section(**fields):
    """A mapping; a field that is None in one example is absent from it."""
    return st.fixed_dictionaries(fields).map(lambda d: {k: v for k, v in d.items() if v is not None})


def maybe(strategy):
    return st.none() | strategy


def modal():
    return section(kind=st.just("modal"), ratio=ratios | st.lists(ratios, min_size=1, max_size=3))


def rayleigh():
    return section(kind=st.just("rayleigh"), mass=maybe(ratios), stiffness=maybe(ratios))


def snubbers(place):
    common = section(
        side=st.sampled_from(["below", "above"]),
        mounted_on=maybe(st.sampled_from(["base", "ground"])),
        stiffness=numbers,
        damping=maybe(
            section(kind=st.just("ratio"), ratio=ratios) | section(kind=st.just("viscous"), coefficient=numbers)
        ),
        law=maybe(st.sampled_from(["kelvin_voigt", "no_tension"])),
    )
    contact = section(gap=maybe(anything)) | section(preload=numbers)
    one = st.builds(lambda a, b, c: a | b | c, common, contact, place)
    return st.lists(one, max_size=3)


def excitations(point):
    phase = maybe(anything)
    base = st.sampled_from(["acceleration", "velocity", "displacement"])
    tone = section(level=anything, frequency=frequencies, phase=phase)
    on_base = (
        section(kind=st.just("harmonic"), applied_to=st.just("base"), level=anything, frequency=frequencies,
                phase=phase, quantity=maybe(base))
        | section(kind=st.just("multi_tone"), applied_to=st.just("base"), tones=st.lists(tone, min_size=1, max_size=3),
                  quantity=maybe(base))
        | section(kind=st.just("step"), applied_to=st.just("base"), level=anything, time=maybe(numbers),
                  duration=maybe(durations))
        | section(kind=st.sampled_from(["sawtooth", "trapezoid"]), applied_to=st.just("base"), level=anything,
                  duration=durations)
        | section(kind=st.just("half_sine"), applied_to=st.just("base"), level=anything, duration=durations,
                  quantity=maybe(st.sampled_from(["acceleration", "velocity"])))
    )  # fmt: skip
    at_point = section(kind=st.just("harmonic"), applied_to=point, level=anything, frequency=frequencies) | section(
        kind=st.just("step"), applied_to=point, level=anything, time=maybe(numbers)
    )
    return on_base | at_point | section(kind=st.just("none"))


@st.composite
def beams(draw):
    length = draw(numbers)
    inside = st.floats(0.01, 0.99).map(lambda part: part * length)
    place = section(position=inside)
    flat = section(width=numbers, thickness=numbers)
    other = section(
        section=section(kind=st.just("general"), area=numbers, second_moment=numbers, extreme_fibre=numbers)
        | section(kind=st.just("rectangle"), width=numbers, thickness=numbers)
    )
    support = st.sampled_from(["clamped", "pinned", "free", "guided"])
    beam = {
        "length": length,
        "youngs_modulus": draw(numbers),
        "density": draw(numbers),
        "elements": draw(st.integers(2, 100)),
        "supports": {"left": draw(support), "right": draw(support)},
        "damping": draw(modal() | rayleigh() | section(kind=st.just("viscous"), coefficient=numbers)),
        "point_masses": draw(st.lists(section(position=inside, mass=numbers), max_size=2)),
        **draw(flat | other),
    }
    return {
        "beam": beam,
        "snubbers": draw(snubbers(place)),
        "excitation": draw(excitations(place)),
        "constant_forces": draw(st.lists(section(position=inside, force=anything), max_size=2)),
        "probes": [{"name": name, "position": draw(inside)} for name in draw(st.lists(names, max_size=3, unique=True))],
        "run": draw(maybe(runs(section(mode=st.integers(1, 9), amplitude=anything)))),
    }


@st.composite
def chains(draw):
    count = draw(st.integers(1, 4))
    springs = draw(st.integers(count, count + 1))
    number = st.integers(1, count)
    vector = st.lists(anything, min_size=count, max_size=count)
    place = section(mass=number)
    chain = {
        "masses": draw(st.lists(numbers, min_size=count, max_size=count)),
        "springs": draw(st.lists(st.just(0.0) | numbers, min_size=springs, max_size=springs)),
        "damping": draw(maybe(modal() | rayleigh())),
        "snubbers": draw(snubbers(place)),
        "springs_to_ground": draw(
            st.lists(section(mass=number, kind=st.sampled_from(["linear", "cubic"]), stiffness=numbers), max_size=2)
        ),
    }
    if draw(st.booleans()):
        chain["dashpots"] = draw(st.lists(ratios, min_size=springs, max_size=springs))
    if chain["damping"] is None:
        del chain["damping"]
    return {
        "chain": chain,
        "excitation": draw(excitations(place)),
        "probes": [{"name": name, "mass": draw(number)} for name in draw(st.lists(names, max_size=3, unique=True))],
        "run": draw(
            maybe(runs(section(displacement=vector, velocity=maybe(vector)) | section(mode=number, amplitude=anything)))
        ),
        "nnm": draw(maybe(section(mode=number, energy=maybe(numbers)))),
    }


def runs(start):
    return section(
        duration=durations,
        start=maybe(st.sampled_from(["rest", "static_equilibrium"]) | start),
        spectrum=maybe(section(window=st.sampled_from(["hann", "flattop", "rectangular"]))),
        method=maybe(st.sampled_from(["exact", "reference"])),
        integrator=maybe(st.sampled_from(["BDF", "DOP853"])),
        rtol=maybe(st.floats(1e-13, 1e-2)),
    )


def build(structure, title, gravity, reduction):
    data = structure | {"title": title, "gravity": gravity, "reduction": reduction}
    return {key: value for key, value in data.items() if value is not None}


scenarios = st.builds(
    build,
    beams() | chains(),
    # any text, and text that a YAML reader may take for something else
    st.text(max_size=20)
    | st.sampled_from(["2e5", "off", "null", "true", "1:30", "~", "=", "- a", "a: b", "'", "\n", ".inf"]),
    anything,
    maybe(section(modes=st.integers(1, 50) | st.just("all")) | section(highest_frequency=frequencies)),
)


@settings(deadline=None, max_examples=25, suppress_health_check=[HealthCheck.too_slow, HealthCheck.data_too_large])
@given(scenarios)
def test_yaml_round_trip(data):
    scenario = load_scenario(data)
    text = scenario.to_yaml()
    again = load_scenario(text)
    assert again == scenario
    assert hash(again) == hash(scenario)
    assert again.to_yaml() == text
    assert again.title == data["title"]
    for doubt in scenario.warnings:
        assert doubt


@settings(deadline=None, max_examples=50)
@given(st.text(alphabet="{}[]:,-#&*!|>'\"% \n\tab1.e<", max_size=40))
def test_any_text_is_yaml_or_a_problem(text):
    assert problems(lambda: parse(text)) is not None


trees = st.recursive(
    st.none()
    | st.booleans()
    | st.integers()
    | st.floats()
    | st.text(max_size=5)
    | st.sampled_from(["2 g", "none", "base"]),
    lambda inner: (
        st.lists(inner, max_size=3)
        | st.dictionaries(
            st.sampled_from(
                [
                    "beam",
                    "chain",
                    "length",
                    "kind",
                    "masses",
                    "springs",
                    "snubbers",
                    "excitation",
                    "level",
                    "run",
                    "start",
                    "side",
                    "mass",
                    "position",
                ]
            ),
            inner,
            max_size=4,
        )
    ),
    max_leaves=12,
)


@settings(deadline=None, max_examples=50, suppress_health_check=[HealthCheck.too_slow])
@given(
    st.dictionaries(
        st.sampled_from(
            [
                "beam",
                "chain",
                "snubbers",
                "gravity",
                "excitation",
                "probes",
                "run",
                "reduction",
                "sweep",
                "nnm",
                "title",
                "what",
            ]
        ),
        trees,
        max_size=4,
    )
)
def test_any_mapping_is_a_scenario_or_problems(data):
    assert problems(lambda: load_scenario(data)) is not None


@settings(deadline=None, max_examples=25)
@given(scenarios, st.data())
def test_spoilt_scenarios_never_end_in_a_traceback(data, draw):
    """Replace one value anywhere by any other: a scenario or problems, nothing else."""
    spots = []

    def collect(value):
        if isinstance(value, dict):
            for key, item in value.items():
                spots.append((value, key))
                collect(item)
        elif isinstance(value, list):
            for index, item in enumerate(value):
                spots.append((value, index))
                collect(item)

    collect(data)
    holder, key = draw.draw(st.sampled_from(spots))
    holder[key] = draw.draw(trees)
    assert problems(lambda: load_scenario(data)) is not None


@settings(deadline=None, max_examples=80)
@given(st.text(max_size=12) | st.from_regex(r"\d{1,3}(\.\d)? ?[a-zA-Z%/^*²() 0-9·-]{1,8}", fullmatch=True))
def test_any_text_is_a_quantity_or_a_unit_error(text):
    for dimension in (units.LENGTH, units.FREQUENCY, units.ACCELERATION, units.RATIO):
        with contextlib.suppress(units.UnitError):
            assert abs(units.read_quantity(text, dimension)) < float("inf")


@given(st.floats(-1e30, 1e30).filter(lambda x: x == 0.0 or abs(x) >= 1e-30))
def test_numbers_survive_text(number):
    assert units.read_quantity(repr(number), units.LENGTH) == number
    assert units.read_quantity(f"{number!r} m", units.LENGTH) == number
