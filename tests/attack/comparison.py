"""One random system: its motion by the package and by `own_model`, and what differs between them.

Compared up to the round-off horizon, the last output before two integrations of our own, with other steps and with
numbers that differ by 1e-10 of their values, tell different stories: times and contacts of all events, displacement of
the probe, stored energy, peaks of displacement and of contact forces. How far the two are apart is what the package may
differ by, but for a factor; where it differs by more, the sensitivity is measured anew with more changed numbers.
"""

import time as clock
from collections import Counter
from dataclasses import dataclass, field
from functools import cached_property
from typing import NamedTuple

import numpy as np
from own_laws import Bent, Pad
from own_model import Equations, model_of
from random_systems import PERIODS, random_case

MOST_STEPS = 12_000
OUTPUTS = 40
PERTURBATIONS = 1e-10, 1e-12, 1e-14  # of all numbers, for the second integration; smaller where that parts at once
OTHERS = (0.77, 0.85, 0.71, 0.93, 0.64)  # steps of the integrations with changed numbers; the first is the usual one
FINER = (20, 60)  # parts of the step where the two differ
SMALL = 1e-12  # change of a scenario's numbers that shows how well they determine its motion
CHANGED = {"masses", "springs", "stiffness", "gap", "preload", "level", "force", "bending_stiffness", "mass_per_length"}
CHANGED |= {
    "youngs_modulus",
    "density",
    "coefficient",
    "stiffnesses",
    "breakpoints",
    "normal_force",
    "force_deflection",
}
APART = "parts at once"  # no motion of ours that a change of the last digits leaves as it is
ALONE = "agrees in its states"  # and its contacts cannot be compared
LEAST = 0.01  # of a motion that is compared by its states
STORY = 1e-5  # relative difference of our two integrations at which the horizon lies
RESOLUTION = 1e-9  # of our own integration
BEGIN = 1e-7  # of the end: a motion that starts at zero gap closes at 0 or as soon as it is felt
AT_START = 1e-11  # of the sum of its terms: what counts as zero at t = 0
AT_ONCE = 1e-9  # of that: earlier ends of contacts are those of a start on a border, by round-off


@dataclass
class Finding:
    """What came of one system."""

    seed: int
    features: list
    outcome: str  # agrees, differs, or why it was not compared
    differences: list = field(default_factory=list)
    events: int = 0
    periods: float = 0.0  # of the first mode, compared
    share: float = 0.0  # of the intended duration, compared
    seconds: tuple = (0.0, 0.0)  # ours; the package, and ours with finer steps where these differ
    finer: int = 1
    reason: str = ""  # why a difference is none of the package
    deviation: float = 0.0  # largest difference of the probe's displacement, over its largest displacement
    used: float = 0.0  # largest part of the allowed difference that it takes


@dataclass(frozen=True)
class Own:
    """Our equations and our motion, those with changed numbers, and by how much they differ."""

    equations: Equations
    motion: object
    others: list
    outputs: np.ndarray  # (k,) indices of the stops that are outputs, up to the horizon
    apart: np.ndarray  # (nt,) largest difference so far, over the largest state
    whole: float  # s, intended
    step: float  # s, the longest
    most_steps: int  # of the motion

    @cached_property
    def starting_phases(self):
        return self.equations.starting_phases(self.step)

    @property
    def size(self):
        """Largest norm of the modal displacements, the start included, m sqrt(kg)."""
        y = np.vstack([self.equations.start(), self.motion.y])
        return float(np.linalg.norm(y[:, : self.equations.n], axis=1).max() / self.equations.scale)

    @property
    def probe(self):
        """Norm of the probe's row, 1/sqrt(kg)."""
        return float(np.linalg.norm(self.equations.model.probes["probe"]))


def compare(seed, folder, most_steps=MOST_STEPS):
    """Draw the system of a seed and compare."""
    begin = clock.process_time()
    case, features = random_case(seed, folder)
    for change in PERTURBATIONS:
        own = own_motion(case, most_steps, change=change)
        if own != APART:
            break
    else:
        return _states_alone(Finding(seed, sorted(features), APART), case)
    middle = clock.process_time()
    if isinstance(own, str):
        return Finding(seed, sorted(features), own)
    finding = _against_package(Finding(seed, sorted(features), "agrees"), case, own)
    for finer in FINER:
        if not finding.differences:
            break
        own = own_motion(case, finer * most_steps, OTHERS, finer=finer, change=change)
        if isinstance(own, str):
            return Finding(seed, sorted(features), own)
        finding = _against_package(Finding(seed, sorted(features), "agrees"), case, own)
        if finding.differences and (reason := _ill_conditioned(case, own)):
            finding.outcome, finding.differences, finding.reason = "ill-conditioned", [], reason
    finding.seconds = (middle - begin, clock.process_time() - middle)
    return finding


def own_motion(case, most_steps=MOST_STEPS, others=OTHERS[:1], finer=1, change=PERTURBATIONS[0], story=True):
    """Our motion of a scenario, or why there is none; without its ``story`` it lasts while the states agree."""
    spec = case["excitation"]
    model = model_of(case, spec["period"] / 1.1 if spec["kind"] == "random" else 1.0)
    if model is None:
        return "no equilibrium to start from"
    equations = Equations(model)
    fast, slow = equations.periods()
    longest = {"random": spec.get("period", 0.0) / 1.1, "swept_sine": 0.8 * PERIODS * slow}.get(
        spec["kind"], PERIODS * slow
    )
    if spec["kind"] == "sampled":
        longest = float(model.inputs.knots[-1]) / 1.05
    if spec["kind"] == "swept_sine":
        longest = min(longest, 0.999 * abs(spec["to"] - spec["from"]) / float(spec["rate"].split()[0]))
    step = fast / 10 / finer
    longest = whole = min(longest, most_steps * step)
    for _ in range(4):  # a shorter part where the two part early
        times = longest * np.arange(1, OUTPUTS + 1) / OUTPUTS
        stops = np.unique(np.concatenate([times, [b for b in model.inputs.breaks if 0 < b < longest]]))
        motion = equations.move(stops, step, most_steps)
        changed = [equations.perturbed(change, motion, draw) for draw in range(len(others))]
        moved = [c.move(stops, part * step, 2 * most_steps) for c, part in zip(changed, others, strict=True)]
        ends, aparts = zip(*(_horizon(motion, other, step, story) for other in moved), strict=True)
        end, count = min(ends), min(a.size for a in aparts)
        apart = np.max([a[:count] for a in aparts], axis=0)
        outputs = np.flatnonzero(np.isin(stops[: apart.size], times) & (stops[: apart.size] <= end))
        if outputs.size > OUTPUTS // 4:
            return Own(equations, motion, moved, outputs, apart, whole, step, most_steps)
        longest *= max(outputs.size, 1) / OUTPUTS
        step = min(step, longest / OUTPUTS)
    return APART


def _horizon(motion, other, step, story):
    """Until when our two motions tell the same story, and (nt,) how far apart they are until each stop."""
    count = min(motion.time.size, other.time.size)
    if count == 0:
        return 0.0, np.zeros(0)
    scale = np.abs(motion.y[:count]).max() or 1.0
    apart = np.maximum.accumulate(np.abs(motion.y[:count] - other.y[:count]).max(axis=1) / scale)
    end = float(motion.time[count - 1])
    far = np.flatnonzero(~(apart < STORY))
    if far.size:
        end = float(motion.time[far[0] - 1]) if far[0] else 0.0
    if not story:
        return end, apart
    both = [(m.event_time, m.event_contact, m.event_phase) for m in (motion, other)]
    for contact in np.unique(np.concatenate([motion.event_contact, other.event_contact])):
        (t1, p1), (t2, p2) = ((t[j == contact], p[j == contact]) for t, j, p in both)
        n = min(t1.size, t2.size)
        wrong = np.flatnonzero((p1[:n] != p2[:n]) | (np.abs(t1[:n] - t2[:n]) > 0.05 * step))
        if wrong.size:
            end = min(end, 0.999 * t1[wrong[0]], 0.999 * t2[wrong[0]])
        elif t1.size != t2.size:
            end = min(end, 0.999 * (t1 if t1.size > n else t2)[n])
    return end, apart


def _states_alone(finding, case):
    """Compare displacement and energy of a motion whose contacts no change of the last digits leaves as they are.

    Such contacts are too shallow or too short to be told from others; the motion itself need not feel them.
    """
    for change in PERTURBATIONS:  # a small part of the motion may be all that larger changes leave
        own = own_motion(case, others=OTHERS, change=change, story=False)
        if own != APART and own.motion.time[own.outputs[-1]] > LEAST * own.whole:
            break
    for finer in (1, *FINER):
        if finer > 1:
            own = own_motion(case, finer * MOST_STEPS, OTHERS, finer=finer, change=change, story=False)
        if isinstance(own, str):
            return finding
        result, finding.finer = _package(case, own)
        finding.differences = _states(own, result, 5 * own.apart[own.outputs] + RESOLUTION, finding.finer)
        if not finding.differences:
            break
    finding.outcome = "differs" if finding.differences else ALONE
    end = float(own.motion.time[own.outputs[-1]])
    finding.periods, finding.share = end / own.equations.periods()[1], end / own.whole
    finding.reason = (
        f"states are apart by {own.apart[own.outputs[-1]]:.1e} of the motion where numbers change by {change}"
    )
    return finding


def _against_package(finding, case, own):

    end = float(own.motion.time[own.outputs[-1]])
    try:
        result, finding.finer = _package(case, own)
    except Exception as error:
        finding.outcome, finding.differences = "differs", [f"{type(error).__name__}: {error}"]
        return finding
    if result.outcome.code == "energy_not_balanced":
        finding.outcome = "not trusted by the package"
        return finding
    if not result.complete:
        finding.outcome, finding.differences = "differs", [f"outcome: {result.status}"]
        return finding
    slack = 5 * own.apart[own.outputs] + RESOLUTION
    error = result.summary["energy_error"]
    if not error < max(1e-8, slack[-1]):
        finding.differences.append(f"energy error {error:.3g}")
    finding.events = int(np.sum(own.motion.event_time < end))
    finding.differences += [
        *_events(own, _found_events(result), end),
        *_states(own, result, slack, finding.finer),
        *_peaks(own, result, slack[-1]),
    ]
    finding.periods, finding.share = end / own.equations.periods()[1], end / own.whole
    if size := _displacement_size(own):
        error = np.abs(np.subtract(*_displacements(own, result, finding.finer))) / size
        finding.deviation, finding.used = float(error.max()), float(np.max(error / slack))
    if finding.differences:
        finding.outcome = "differs"
    return finding


def _package(case, own):
    """The package's result, and its outputs for each of ours."""
    import beamsim

    end, count = float(own.motion.time[own.outputs[-1]]), own.outputs.size
    finer = int(np.ceil(max(2.5 * _fastest(case) * end / count, 1.0)))
    not_compared = {"convergence": "off", "spectrum": {"last": end / 50}}
    run = {**case["run"], **not_compared, "duration": end, "sample_rate": finer * count / end}
    return beamsim.run(beamsim.Scenario.model_validate({**case, "run": run})), finer


def _fastest(case):
    """Highest frequency of the sines of an input, Hz."""
    spec = case["excitation"]
    return max(tone.get("frequency", 0.0) for tone in [spec, *spec.get("tones", ()), *spec.get("forces", ())])


def _contacts(own, motion, contact):
    """Times at which a contact of ours begins or ends, whether it begins, and which of the motion's events they are.

    Events within contact, as from segment to segment of a table, are left out.
    """
    law = own.equations.model.contacts[contact].of
    at = np.flatnonzero(motion.event_contact == contact)
    touching = np.array([law.touching(phase) for phase in motion.event_phase[at]], dtype=bool)
    before = np.append(law.touching(own.starting_phases[contact]), touching[:-1])
    at = at[touching != before]
    return motion.event_time[at], touching[touching != before]


def _ill_conditioned(case, own):
    """Why our motion differs, where changes of the scenario's numbers by 1e-12 move the package's as far; else ''.

    Displacements and event times (of each snubber; the number of its events where that is not the same) must both lie
    within five times what the changes do.
    """
    end = float(own.motion.time[own.outputs[-1]])

    begin = BEGIN * end

    def measured(case):
        result, finer = _package(case, own)
        if not result.complete:  # with other last digits: what it shows is no motion to compare with
            raise ValueError(result.status)
        late = result["events"]["time"].values > begin
        times = [
            result["events"]["time"].values[late & (result["events"]["snubber"].values == k)]
            for k in range(len(result["histories"].labels("snubber")))
        ]
        return (
            result["histories"]["displacement"].sel(probe="probe").values[finer::finer],
            times,
            result["histories"].labels("snubber"),
        )

    try:
        displacement, times, names = measured(case)
        others = [measured(_changed(case, np.random.default_rng(draw))) for draw in range(len(OTHERS))]
    except Exception:
        return ""
    ours = own.equations.displacement(own.motion.y[own.outputs], "probe")
    all_names = [c.name for c in own.equations.model.contacts]
    motion = own.motion
    mine = [_contacts(own, motion, all_names.index(n))[0] for n in names]
    mine = [times[(times > begin) & (times < end)] for times in mine]

    def apart(other, other_times):
        late = [
            np.abs(a - b).max(initial=0.0) if a.size == b.size else end for a, b in zip(times, other_times, strict=True)
        ]
        return np.array([np.abs(other - displacement).max(), *late])

    change = np.max([apart(d, t) for d, t, _ in others], axis=0)
    difference = apart(ours, mine)
    resolution = np.array([RESOLUTION * own.probe * own.size, *(1e-7 * end for _ in names)])
    if np.all(difference <= 5 * change + resolution) and np.any(5 * change > resolution):
        return f"displacement and events differ by {difference}, numbers changed by {SMALL} move them by {change}"
    return ""


def _changed(node, rng, changing=False):
    """A scenario with its stiffnesses, masses, gaps and loads changed by `SMALL` of their values."""
    if isinstance(node, dict):
        return {key: _changed(value, rng, changing or key in CHANGED) for key, value in node.items()}
    if isinstance(node, list):
        return [_changed(value, rng, changing) for value in node]
    return node * (1 + SMALL * rng.choice([-1.0, 1.0])) if changing and isinstance(node, float) else node


class _Events(NamedTuple):
    """Contact events of the package, and how often bends of a law were passed."""

    names: list[str]  # of the snubbers
    snubber: np.ndarray  # (n,) number of each event
    time: np.ndarray  # (n,)
    closing: np.ndarray  # (n,)
    bends: int


def _found_events(result):
    events = result["events"]
    columns = (events[name].values for name in ("snubber", "time", "closing"))
    return _Events(result["histories"].labels("snubber"), *columns, result.summary.get("breakpoints_passed", 0))


def _passed_over_at_start(own, j):
    """Whether a contact of ours must be made at t = 0 but has ended before our motion first looks.

    It does where its penetration is zero and, as long as it is open, grows: by the velocities, else by the
    accelerations. What acts against it may end it in nanoseconds.
    """
    equations, law = own.equations, own.equations.model.contacts[j].of
    if not law.pushes or law.touching(own.starting_phases[j]):
        return False
    row, rate = equations.penetration(equations.model.contacts[j])
    whole = np.append(equations.start(), equations.model.inputs.at(0.0))
    if abs(row @ whole) > AT_START * (np.abs(row) @ np.abs(whole)):
        return False
    state = equations.linear(own.starting_phases)
    rates, rest = np.hstack([state.A, state.B]), np.zeros(equations.U)
    slopes, sizes = (np.append(x, rest) for x in (rates @ whole, np.abs(rates) @ np.abs(whole)))
    if equations.U == 4:  # the slope of the base's velocity is its acceleration
        slopes[-2], sizes[-2] = whole[-3], abs(whole[-3])
    for value, size in ((rate @ whole, np.abs(rate) @ np.abs(whole)), (rate @ slopes, np.abs(rate) @ np.abs(sizes))):
        if abs(value) > AT_START * size:
            return value > 0
    return False


def _events(own, found_events, end):
    """Contacts and times of the snubbers' events, and the number of bends passed; those at t = 0 do not count."""
    found = []
    slack = 5 * own.apart[own.outputs[-1]] + RESOLUTION
    names = [c.name for c in own.equations.model.contacts]
    edge, begin = end * (1 - 1e-9), BEGIN * end
    for j, name in enumerate(names):
        if name not in found_events.names:
            continue
        t, begins = _contacts(own, own.motion, j)
        keep = (t > begin) & (t < edge)
        short = np.sum(~begins & (t > AT_ONCE * begin) & (t <= begin))  # against a stop stiff enough
        others = [_contacts(own, m, j)[0] for m in own.others]
        late = [np.abs(o[: keep.size][keep[: o.size]] - t[: o.size][keep[: o.size]]) for o in others]
        t, begins = t[keep], begins[keep]
        mine = found_events.snubber == found_events.names.index(name)
        early = mine & (found_events.time <= begin)
        if early.sum() > 1 and np.sum(early & ~found_events.closing) > short + _passed_over_at_start(own, j):
            found.append(f"{name}: begins and ends at the start")
        mine &= (found_events.time > begin) & (found_events.time < edge)
        theirs, closing = found_events.time[mine], found_events.closing[mine]
        if t.size == theirs.size and np.array_equal(begins, closing):
            allowed = np.maximum.accumulate(5 * np.max(late, axis=0, initial=0.0) + 1e-7 * end)
            if np.any(np.abs(t - theirs) > allowed):
                k = int(np.argmax(np.abs(t - theirs) > allowed))
                found.append(f"{name}: event {k + 1} of {t.size} at {t[k]:.12g} s is at {theirs[k]:.12g} s")
        elif (at := _parting(own, j, (t, begins), (theirs, closing), end, slack)) < edge:
            found.append(
                f"{name}: {t.size} events of ours, {theirs.size} of the package; they part at {at:.9g} of {end:.6g} s"
            )
    bends = [j for j, c in enumerate(own.equations.model.contacts) if isinstance(c.of, Bent)]
    passed = np.isin(own.motion.event_contact, bends) & (own.motion.event_time < edge)
    listed = found_events.bends
    if passed.sum() != listed and not any(_at_a_bend(own, j, end, slack) for j in bends):
        found.append(f"{passed.sum()} bends passed, {listed} by the package")
    return found


def _parting(own, contact, ours, theirs, end, slack):
    """Time of the first event that only one of two lists (times, closing) holds, inf for none.

    Contacts and gaps so shallow that the motions cannot tell them from none do not count.
    """
    i = k = 0
    while i < ours[0].size or k < theirs[0].size:
        both = i < ours[0].size and k < theirs[0].size
        if both and ours[1][i] == theirs[1][k] and abs(ours[0][i] - theirs[0][k]) < 1e-6 * end:
            i, k = i + 1, k + 1
            continue
        first = i < ours[0].size and (not both or ours[0][i] < theirs[0][k])
        times = (ours[0][i : i + 2] if first else theirs[0][k : k + 2]).tolist()
        if _depth(own, contact, np.linspace(times[0], times[-1], 5), end).max() > slack:
            return times[0]
        i, k = (i + len(times), k) if first else (i, k + len(times))
    return np.inf


def _depth(own, contact, times, end):
    """Distance from the end of the phase at some times, over the size of the motion at the place of the contact.

    It is that from touching, or of a face that pushes its force over its stiffness.
    """
    equations, law = own.equations, own.equations.model.contacts[contact]
    forced = isinstance(law.of, Pad) or law.of.phases > 2  # it ends by its force, not by its penetration
    moved = equations.move(np.unique([*times, *own.motion.time[own.motion.time < end]]), own.step, 2 * own.most_steps)
    at = np.flatnonzero(np.isin(moved.time, times))
    depth = []
    for whole, phases in zip(equations.whole(moved)[at], moved.phases[at], strict=True):
        unit = law.stiffness if forced and law.of.touching(phases[contact]) else 1.0
        depth.append(min(abs(row @ whole) / unit for row, *_ in equations.guards(contact, phases[contact])))
    return np.array(depth) / (np.linalg.norm(law.row) * own.size)


def _at_a_bend(own, contact, end, slack):
    """Whether the stretch of a spring turns, starts or ends at one of its bends, as far as the motions can tell."""
    equations = own.equations
    law = equations.model.contacts[contact]
    times = np.union1d(np.linspace(0.0, end, 20_000)[1:], own.motion.time[own.motion.time <= end])
    moved = equations.move(times, own.step, times.size + 2 * own.most_steps)
    stretch, rate = (equations.whole(moved) @ row for row in equations.penetration(law))
    turns = np.flatnonzero(rate[1:] * rate[:-1] <= 0.0)
    farther = np.abs(np.diff(stretch))[turns]  # a turn between two samples is that much farther at most
    near = slack * np.linalg.norm(law.row) * own.size
    start = equations.penetration(law)[0] @ np.append(equations.start(), equations.model.inputs.at(0.0))
    ends = np.abs(np.subtract.outer([start, stretch[-1]], law.of.bends)).min() < near
    return ends or np.any(np.abs(np.subtract.outer(stretch[turns], law.of.bends)) < near + farther[:, None])


def _displacements(own, result, finer):
    """The probe's displacement at the outputs, m: ours, and the package's."""
    ours = own.equations.displacement(own.motion.y[own.outputs], "probe")
    return ours, result["histories"]["displacement"].sel(probe="probe").values[finer::finer]


def _displacement_size(own):
    """The largest displacement that the probe can have, m, also in a motion that has decayed at the first output."""
    return max(own.probe * own.size, own.motion.largest[own.outputs[-1], :2].max())


def _states(own, result, slack, finer):
    """Displacement of the probe and stored energy at the outputs."""
    found = []
    equations, motion = own.equations, own.motion
    ours, theirs = _displacements(own, result, finer)
    error, allowed = np.abs(ours - theirs), slack * _displacement_size(own)
    if np.any(~(error <= allowed)):
        k = int(np.argmax(~(error <= allowed)))
        found.append(
            f"displacement at {motion.time[own.outputs[k]]:.6g} s: {ours[k]:.9g} m, {theirs[k]:.9g} m by the package"
        )
    stored, *others = (equations.stored(m)[own.outputs] for m in (motion, *own.others))
    moved = 5 * np.max(np.abs(np.array(others) - stored), axis=0)  # drift that stores nothing may hide it in the states
    energy = result["histories"]["energy_stored"].values[finer::finer]
    # at the start, and in between
    largest = max(np.abs(stored).max(), np.abs(result["histories"]["energy_stored"].values).max(), 1e-300)
    wrong = ~(np.abs(stored - energy) <= 5 * slack * largest + np.maximum.accumulate(moved))
    if np.any(wrong):
        k = int(np.argmax(wrong))
        found.append(
            f"stored energy at {motion.time[own.outputs[k]]:.6g} s: {stored[k]:.9g} J, {energy[k]:.9g} J by the package"
        )
    return found


def _peaks(own, result, slack):
    """Largest displacement of the probe and contact forces until the end."""
    found = []
    equations, motion = own.equations, own.motion
    largest = motion.largest[own.outputs[-1]]
    moved = 5 * np.max([np.abs(m.largest[own.outputs[-1]] - largest) for m in own.others], axis=0)
    size, allowed = own.size, slack * own.probe * own.size
    pairs = [
        ("largest displacement", largest[0], result.summary["max_displacement_m"]["probe"], allowed + moved[0]),
        ("smallest displacement", -largest[1], result.summary["min_displacement_m"]["probe"], allowed + moved[1]),
    ]
    k = 2
    speed = np.linalg.norm(motion.y[:, equations.n : 2 * equations.n], axis=1).max()
    for contact in equations.model.contacts:
        if not contact.of.pushes:
            continue
        allowed = slack * np.linalg.norm(contact.row) * (contact.stiffness * size + contact.dashpot * speed)
        theirs = result.summary["peak_force_n"][contact.name]
        name = f"{contact.name}: largest force"
        pairs.append((name, max(largest[k], 0.0), max(theirs, 0.0), allowed + moved[k]))
        k += 1
    for name, ours, theirs, allowed in pairs:
        if not abs(ours - theirs) <= allowed + 1e-7 * abs(ours):
            found.append(f"{name}: {ours:.9g}, {theirs:.9g} by the package")
    return found


def caught(seeds, folder, most_steps=6000):
    """The first difference in events or states of the systems of some seeds, '' where there is none.

    Without what makes a result of a motion: extremes, energies and spectra, whose kernels take long to compile.
    """
    for seed in seeds:
        case, _ = random_case(seed, folder)
        own = own_motion(case, most_steps)
        if isinstance(own, str):
            continue
        try:
            bare = _Bare(case, float(own.motion.time[own.outputs[-1]]), own)
        except Exception as error:
            return f"seed {seed}: {type(error).__name__}: {error}"
        found = [*_events(own, bare.events, bare.end), *bare.states(5 * own.apart[own.outputs] + 1e-7)]
        if found:
            return f"seed {seed}: {found[0]}"
    return ""


class _Bare:
    """A motion of the package without its evaluation: its events and displacement."""

    def __init__(self, case, end, own):
        import beamsim
        from beamsim.flow.exact import exact_flow
        from beamsim.flow.transient import simulate
        from beamsim.system.build import build_system

        rate = 400 / end + 3 * _fastest(case)
        run = {**case["run"], "duration": end, "sample_rate": rate}
        scenario = beamsim.Scenario.model_validate({**case, "run": run})
        system = build_system(scenario)
        trajectory = simulate(exact_flow(system, end), system.initial_state, max_events=5000, max_evaluations=200_000)
        self.end, self.own = end, own
        count = len(system.snubbers)
        real = trajectory.event_contact < count
        self.events = _Events(
            [snubber.name for snubber in system.snubbers],
            trajectory.event_contact[real],
            trajectory.event_time[real],
            (trajectory.touch_changes > 0)[real],
            int(np.sum(~real)),
        )
        self.displacement = trajectory.states_at(own.motion.time[own.outputs])[:, : system.probes[0].shape.size]
        self.displacement = self.displacement @ system.probes[0].shape

    def states(self, slack):
        own = self.own
        ours = own.equations.displacement(own.motion.y[own.outputs], "probe")
        error = np.abs(ours - self.displacement)
        return ["displacement differs"] if np.any(~(error <= slack * own.size * own.probe)) else []


def summarise(findings):
    """Counts of outcomes, of features among what was compared, and of features among what differs."""
    outcomes, features, differing = Counter(), Counter(), Counter()
    for finding in findings:
        outcomes[finding.outcome] += 1
        if finding.outcome in ("agrees", ALONE, "differs"):
            features.update(finding.features)
            if finding.differences:
                differing.update(finding.features)
    return outcomes, features, differing
