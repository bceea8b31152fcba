"""What a response curve holds: coexisting and symmetry-broken motions, maxima between points, what was left out."""

import itertools

import numpy as np
import pytest
from sampling import first_apart
from scipy.integrate import solve_ivp
from shipped import config_path

from beamsim.analyses.continuation.analysis import continuation
from beamsim.cli.tables import all_rows, table_rows
from beamsim.orbits.continuation import Settings, solve_at
from beamsim.outcomes import OutcomeKind
from beamsim.responses.parameters import response_model
from beamsim.results.branch import harmonics_of
from beamsim.scenario import Scenario, load_scenario
from tests.helpers.branches import events_of, multipliers, peaks_of

BEAM, MASSES = config_path("one_sided_65hz"), config_path("chain_two_dof")
FEW_MODES = "reduction={modes: 2}"
STOPS = """[{name: below, position: 270 mm, side: below, stiffness: 151.1 kN/m, gap: 0.3 mm},
            {name: above, position: 270 mm, side: above, stiffness: 151.1 kN/m, gap: 0.3 mm}]"""


def curve(case, *changes):
    return continuation(load_scenario(case, list(changes)))


def sweep_of(low, high, more=""):
    return f"sweep={{kind: continuation, from: {low}, to: {high}, {more}}}"


def in_level(*changes):
    path = "sweep.continue_in={kind: level, from: 0.2 N, to: 0.1 N}"
    return curve(MASSES, "excitation.frequency=0.72 rad/s", "sweep.from=null", "sweep.to=null", path, *changes)


@pytest.fixture(scope="module")
def levels():
    return in_level()


def test_coexisting_motions_with_contact_are_found(levels):
    """From 0.2 to 0.1 N the linear motion is stable, but motions that meet the stop exist throughout."""
    linear, *others = levels.branches
    assert levels.complete
    assert peaks_of(linear, "stop", "force").max() == 0.0
    for level in (0.1, 0.15, 0.2):
        assert any(
            b["parameter"].values.min() <= level * (1 + 1e-9) and b["parameter"].values.max() >= level * (1 - 1e-9)
            and peaks_of(b, "stop", "force").min() > 0 for b in others
        )  # fmt: skip
    assert any(np.any(b["stable"].values) for b in others)


def test_the_coexisting_motion_attracts_an_independent_integration(levels):
    branch = next(b for b in levels.branches[1:] if b["period_multiple"].item() == 1 and np.any(b["stable"].values))
    k = int(np.flatnonzero(branch["stable"].values)[0])
    level, w = branch["parameter"].values[k], 0.72

    def rates(t, y):
        x1, x2, v1, v2 = y
        stop = -100.0 * max(x1 - 1.0, 0.0)
        f1 = -(x1 - x2) - 0.03 * (v1 - v2) + stop
        f2 = (x1 - x2) + 0.03 * (v1 - v2) - x2 - 0.03 * v2 + level * np.sin(w * t)
        return [v1, v2, f1, f2]

    T = 2 * np.pi / w
    peaks = set()
    for size in (0.0, 2.0):  # initial deflections
        done = solve_ivp(rates, (0, 100 * T), [-size, -0.6 * size, 0, 0], rtol=1e-8, atol=1e-10, max_step=T / 20)
        last = done.t > 99 * T
        peaks.add(round(float(np.abs(done.y[0, last]).max()), 2))
    linear = peaks_of(levels.branches[0], "first")
    assert min(peaks) == pytest.approx(np.interp(level, [0.1, 0.2], [linear.min(), linear.max()]), abs=0.03)
    assert max(peaks) == pytest.approx(peaks_of(branch, "first")[k], rel=0.02)


@pytest.fixture(scope="module")
def symmetric():
    return curve(BEAM, f"snubbers={STOPS}", sweep_of("64 Hz", "72 Hz"))


def test_symmetry_broken_branches_are_followed_and_stable(symmetric):
    """To both sides of the symmetric curve, one the mirror image of the other half a period later."""
    main = symmetric.branches[0]
    assert np.all(np.abs(peaks_of(main, "tip", end="max") + peaks_of(main, "tip", end="min")) < 1e-9)
    assert "branch_point" in {e.kind for e in events_of(symmetric, 0)}
    sides = {1: [], -1: []}
    for branch in symmetric.branches:
        mean = peaks_of(branch, "tip", end="max") + peaks_of(branch, "tip", end="min")
        for k in np.flatnonzero(branch["stable"].values & (np.abs(mean) > 1e-3 * peaks_of(branch, "tip"))):
            if branch["period_multiple"].item() == 1:
                sides[int(np.sign(mean[k]))].append(branch["parameter"].values[k])
    for values in sides.values():
        assert np.ptp(values) > 0.3  # Hz
    broken = [branch for branch in symmetric.summary["followed"] if "off_centre" in branch]
    assert len(broken) >= 4
    assert all(branch["period_multiple"] == 1 for branch in broken)
    assert any("largest mean" in text for _, text in table_rows(symmetric))
    assert len(symmetric.branches) < 20  # no branch is followed again


def test_maxima_are_those_of_the_continuous_curve():
    """Stored points alone gave 4.1527 mm at 81.610 Hz; sought at the middle, the same peak was a branch of its own."""
    values = [81.53, 81.55, 81.57, 81.59, 81.61]
    result = curve(config_path("continuation_60_120hz"), sweep_of(81, 82, f"points_at: {values}, seek_at: 1"))
    (peak,) = [p for p in result.summary["peaks"] if p["probe"] == "tip"]
    assert peak["value_m"] == pytest.approx(4.15427e-3, abs=5e-9)
    assert peak["frequency_hz"] == pytest.approx(81.570, abs=2e-3)
    (branch,) = result.branches
    for value in values:
        (k,) = np.flatnonzero(np.isclose(branch["parameter"].values, value, rtol=1e-13, atol=0.0))
        assert branch["residual"].values[k] < 1e-11
        assert peaks_of(branch, "tip")[k] <= peak["value_m"]


CHAIN = """
chain:
  masses: {masses}
  springs: {springs}
  dashpots: {dashpots}
  snubbers:
    - {{name: stop, mass: 2, side: {side}, gap: {gap}, stiffness: {stiffness}}}
excitation: {{kind: harmonic, frequency: 1, applied_to: base, quantity: acceleration, level: {level}}}
probes: [{{name: second, mass: 2}}]
sweep: {{kind: continuation, from: {low}, to: {high}, seek_at: 0, {more}}}
"""


def corner_case(folder, **values):
    (folder / "case.yaml").write_text(CHAIN.format(**values))
    return curve(folder / "case.yaml")


def test_a_corner_far_from_the_chord_is_found(tmp_path):
    """The contact ends at 1.07045 Hz, outside the step from 1.0812 to 1.0844 Hz that turns round it; the fold is beside
    it.
    """
    result = corner_case(
        tmp_path, masses=[1.3751852637136908, 1.0143135162621095], springs=[79.53955065865617, 135.43627647893888],
        dashpots=[1.1009153961729687, 0.44795080528009634], side="above", gap=0.001011371564876997,
        stiffness=98271.6200108873, level=0.013978230787015065, low=1.06, high=1.2, more="side_branches: none",
    )  # fmt: skip
    branch = result.branches[0]
    assert result.complete
    grazed = [e for e in events_of(result, 0) if e.kind == "grazing"]
    assert np.count_nonzero(np.diff(branch["contact_share"].sel(snubber="stop").values > 0)) == len(grazed) == 1
    assert grazed[0].parameter == pytest.approx(1.0704510935, abs=1e-9)
    fold = min((e for e in events_of(result, 0) if e.kind == "fold"), key=lambda e: e.parameter)
    k = int(np.argmin(np.abs(branch["parameter"].values - fold.parameter)))
    assert np.abs(multipliers(branch)[k] - 1).min() < 1e-6


def test_a_branch_of_doubled_period_ends_where_it_meets_its_own(tmp_path):
    """A step from it passed a grazing and landed on the motions of one period: a fold was reported in between."""
    result = corner_case(
        tmp_path, masses=[0.4075611911579825, 0.9190551567531231], springs=[477.55488638150933, 95.1032419462012],
        dashpots=[1.6035518230200898, 0.9991350082724817], side="below", gap=0.0011031774983679033,
        stiffness=23721.52005076963, level=0.03038011134004967, low=1.192, high=1.42, more="longest_period: 2",
    )  # fmt: skip
    _, doubled = result.branches
    assert result.complete
    assert doubled["outcome"].item() == "back_to_period"
    assert doubled["parameter"].values.min() == pytest.approx(1.19697, abs=5e-5)
    folds = [e.parameter for e in events_of(result, 1) if e.kind in ("fold", "nonsmooth_fold")]
    assert folds == [pytest.approx(1.4190664, abs=1e-6)]


def test_harmonics_are_stored_as_many_as_asked_for():
    branch = curve(BEAM, sweep_of(80, 80.2, "stored_harmonics: 12, seek_at: 0")).branches[0]
    assert harmonics_of(branch)["tip"].shape[1] == 13
    np.testing.assert_array_equal(branch["harmonic"].values, np.arange(13))


def test_branches_end_at_the_ends_of_the_range():
    """The curve from 20 Hz turns back below it before it goes on."""
    result = curve(config_path("continuation_60_120hz"), sweep_of(20, 20.6, "longest_period: 1, seek_at: 0"), FEW_MODES)
    values = np.concatenate([b["parameter"].values for b in result.branches])
    assert values.min() == 20.0
    assert values.max() == pytest.approx(20.6, rel=1e-12)
    assert len(result.branches) > 1


def test_bands_without_a_stable_motion_are_listed():
    result = curve(config_path("continuation_60_120hz"), sweep_of(60, 70, "seek_at: 0"))
    assert result.outcome.kind is OutcomeKind.COMPLETE
    (note,) = result.outcome.sub_outcomes
    assert note.code == "no_stable_motion"
    first, _ = note.place.value
    assert first == pytest.approx((60.0, 62.977585), abs=0.05)  # a Neimark–Sacker point
    assert "no stable motion was found from 60 to 62.9" in result.status
    (bands,) = {tuple(band["band"]) for band in result.summary["without_stable_motion"][:1]}
    assert bands == pytest.approx(first)
    (_, sure), (_, told), *_ = all_rows("continuation", result)
    assert sure.startswith("not checked")
    assert told.lower() == note.text.lower()


def test_no_stable_point_is_in_a_band_without_a_stable_motion():
    """The motion of two periods is stable from 113.103 to 113.148 Hz alone, less than a thousandth of the range."""
    result = curve(config_path("continuation_60_120hz"), sweep_of(100, 120, "seek_at: 0"))
    points = result["points"]
    stable = points["parameter"].values[points["stable"].values]
    bands = [band["band"] for band in result.summary["without_stable_motion"]]
    assert any(high < 113.2 for _, high in bands)
    for low, high in bands:
        assert not np.any((stable > low * (1 + 1e-9)) & (stable < high * (1 - 1e-9))), (low, high)


LIMITS = ["most_side_points: 5", "most_points: 150", "most_branches: 2"]


@first_apart(("limit", "demanded"), 1, itertools.product(LIMITS, [True, False]))
def test_a_limit_that_is_reached_is_an_outcome(limit, demanded):
    more = "side_branches: required, " if demanded else ""
    result = curve(config_path("continuation_60_120hz"), sweep_of(96, 120, f"seek_at: 0, {more}{limit}"))
    assert result.complete is not demanded
    assert (result.outcome.kind is OutcomeKind.INCOMPLETE) is demanded
    assert f"raise sweep.{limit.partition(':')[0]}" in result.status
    assert demanded or result.outcome.outcomes_with_code("side_branches_cut")


def test_harmonic_balance_seeks_coexisting_motions(levels):
    """It begins from what shooting finds; with cubic springs it does not, and says so."""
    balance = in_level("sweep.method={kind: harmonic_balance, harmonics: 15}")
    contact = [b for b in balance.branches if peaks_of(b, "stop", "force").min() > 0]
    exact = [b for b in levels.branches if peaks_of(b, "stop", "force").min() > 0 and b["period_multiple"].item() == 1]
    assert contact
    for branch in contact:
        k = branch["parameter"].values.size // 2
        beside = [
            np.interp(branch["parameter"].values[k], b["parameter"].values[order], peaks_of(b, "first")[order])
            for b in exact for order in [np.argsort(b["parameter"].values)]
        ]  # fmt: skip
        assert min(abs(np.array(beside) / peaks_of(branch, "first")[k] - 1)) < 0.05
    force = "{kind: harmonic, quantity: force, applied_to: {mass: 1}, level: 0.01 N, frequency: 0.1 Hz}"
    cubic = curve(
        config_path("chain_cubic"), "nnm=null", f"excitation={force}", "chain.damping={kind: modal, ratio: 0.02}",
        sweep_of(0.05, 0.06, "method: harmonic_balance"),
    )  # fmt: skip
    assert cubic.outcome.outcomes_with_code("not_sought")


def test_one_branch_does_not_spend_the_points_of_all():
    """Followed from 20 Hz alone, the curve spends hundreds of points below 21 Hz."""
    result = curve(
        config_path("continuation_60_120hz"),
        sweep_of(20, 120, "seek_at: 0, longest_period: 1, most_points: 700, most_branch_points: 300"),
        FEW_MODES,
    )
    covered = [(b["parameter"].values.min(), b["parameter"].values.max()) for b in result.branches]
    assert max(high for _, high in covered) == pytest.approx(120.0)
    assert any(low <= 110 <= high for low, high in covered)
    assert not result.complete


def test_a_contact_with_a_pad_that_has_not_recovered_grazes_its_face():
    """The second contact of a period begins at the face, which lies deeper than the pad at rest."""
    pad = {"name": "stop", "mass": 2, "side": "below", "stiffness": 20e3, "gap": 0.0005}
    pad["maxwell"] = [{"stiffness": 20e3, "relaxation_time": 0.03}]
    chain = {"masses": [2.0, 1.0], "springs": [20e3, 8e3], "damping": {"kind": "modal", "ratio": 0.01}}
    base = {"kind": "harmonic", "applied_to": "base", "level": 9.81, "frequency": 10.0}
    sweep = {"kind": "continuation", "from": 10.3, "to": 10.5, "side_branches": "none"}
    case = Scenario.model_validate({"chain": {**chain, "snubbers": [pad]}, "excitation": base, "sweep": sweep})
    result = continuation(case)
    (branch,) = result.branches
    (grazing,) = (special for special in events_of(result) if special.kind == "grazing")
    model = response_model(case)
    near = int(np.argmin(np.abs(branch["parameter"].values - grazing.parameter)))
    state = [
        each[near]
        for each in (
            branch["coordinates"].values,
            branch["coordinate_velocities"].values,
            branch["internal_states"].values,
        )
    ]
    contacts = []
    for beside in (1.0 - 1e-6, 1.0 + 1e-6):
        omega = 2 * np.pi * grazing.parameter * beside
        point = solve_at(model.problem(model.levels[0]), np.concatenate([*state, [omega]]), Settings(), omega, 1.0)
        contacts.append(point.data.event_contact.size // 2)
    assert contacts == [1, 2]
