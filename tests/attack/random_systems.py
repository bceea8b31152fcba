"""Random scenarios as plain mappings, and the features that each of them has.

Ranges: chains of 1 to 5 masses and beams of 1 to 3 elements (all of their modes kept), one body or two; every support;
one to three snubbers on either side, on the base, on the ground or between two places; stiffness 1e-3 to 1e8 times that
of the structure; laws kelvin_voigt, no_tension and piecewise_linear; gaps of 0, backlash, prestress or a preload;
dashpots by ratio (up to 1.5) or coefficient; no input, or each of the inputs on the base or as a force; every start
but a mode. Seeds from `MORE` on also have force-deflection tables, Maxwell branches, dry friction, several forces and
joints; those from `ASSEMBLIES` on are two or three bodies, imported matrices among them, with joints of every kind,
under a base that moves or turns; those from `LARGE` on are chains of 30 to 80 masses with three or four snubbers.
"""

import numpy as np
from own_model import Structure

SUPPORTS = ("clamped", "pinned", "free", "guided")
LARGEST_RATIO, SMALLEST_RATIO = 8.0, -3.0  # powers of ten of the stiffness ratio
MORE = 10_000_000  # first seed of the systems with tables, branches, friction, several forces and joints
ASSEMBLIES = 20_000_000  # first seed of two or three bodies with joints, imported matrices, and a base that turns
AIMED = 2_000_000_000, 2_000_000_001  # seeds of systems that are not drawn, for faults that these hardly meet
LARGE = 1_000_000_000  # first seed of the systems with many modes
PERIODS = 30.0  # of the first mode, at most


def random_case(seed, folder):
    """A scenario and its features; ``folder`` takes the file of a sampled input."""
    if seed in AIMED:
        return (critically_damped(), overdamped(folder))[AIMED.index(seed)], {"chain", "aimed"}
    return _Draw(np.random.default_rng([seed, 20_10]), folder, seed).case()


def critically_damped():
    """Two masses thrown alike, each with a double eigenvalue, that meet within a tenth of its time constant.

    Their distance falls with the square of time, from rest: all of its curvature is that of tau e^(lambda tau). A step
    of the force ends the piece soon, so that no bound grows with its length.
    """
    stop = {"name": "stop_1", "between": [1, 2], "resists": "approach", "stiffness": 500.0, "gap": 9e-4}
    chain = {
        "masses": [1.0, 1.0],
        "springs": [4.0, 0.0, 36.0],
        "snubbers": [stop],
        "damping": {"kind": "modal", "ratio": 1.0},
    }
    return {
        "title": "critically damped",
        "chain": chain,
        "excitation": {"kind": "step", "applied_to": {"mass": 1}, "level": 1e-3, "time": 0.033},
        "probes": [{"name": "probe", "mass": 2}],
        "run": {"start": {"velocity": [1.0, 1.0]}},
    }


def overdamped(folder):
    """A slow decay under cubic pieces three times as long as the series of their responses hold."""
    file = folder / "input_aimed.csv"
    file.write_text("time,value\n0.0,0.0\n190.0,1.0\n380.0,-1.0\n570.0,0.5\n760.0,0.0\n")
    stop = {"name": "stop_1", "mass": 1, "side": "above", "mounted_on": "base", "stiffness": 3.0, "gap": 0.3}
    return {
        "title": "overdamped",
        "chain": {
            "masses": [1.0],
            "springs": [1.0],
            "snubbers": [stop],
            "damping": {"kind": "modal", "ratio": 11.0},
        },
        "excitation": {
            "kind": "sampled",
            "applied_to": {"mass": 1},
            "file": str(file),
            "quantity": "force",
            "unit": "N",
            "time_unit": "s",
        },
        "probes": [{"name": "probe", "mass": 1}],
        "run": {"start": "rest"},
    }


class _Draw:
    def __init__(self, rng, folder, seed):
        self.rng, self.folder, self.seed = rng, folder, seed
        self.features = set()
        self.large = seed >= LARGE
        self.more = MORE <= seed < LARGE
        self.assembled = ASSEMBLIES <= seed < LARGE

    def chance(self, share):
        return bool(self.rng.random() < share)

    def between(self, low, high):
        return float(self.rng.uniform(low, high))

    def power(self, low, high):
        return float(10 ** self.rng.uniform(low, high))

    def pick(self, *values):
        return values[int(self.rng.integers(len(values)))]

    def case(self):
        self.size = self.power(-5, -2)  # m, of the motion
        kind = self.rng.choice(["chain", "beam", "two"], p=[1.0, 0.0, 0.0] if self.large else [0.45, 0.4, 0.15])
        case = {"title": f"system {self.seed}"}
        if self.assembled:
            kind = "assembly"
            self.assembly(case)
        elif kind == "chain":
            case["chain"] = self.chain()
        elif kind == "beam":
            case["beam"], case["reduction"] = self.beam(), {"modes": "all"}
        else:
            other = self.chain if self.chance(0.4) else self.beam
            specs = {"one": self.beam(True), "two": other(True)}
            case["bodies"] = {
                name: {"kind": "chain" if "masses" in spec else "beam", **spec} for name, spec in specs.items()
            }
            case["reduction"] = {"modes": "all"}
            self.features.add("two bodies")
            if self.more and self.chance(0.6):
                self.joint(case)
        self.structure = Structure(case)
        moving = self.structure.omega[self.structure.omega > 0]
        self.omega = float(moving.min()) if moving.size else 1.0
        self.rigid = self.structure.rigid
        if self.rigid:
            self.features.add("rigid-body mode")
        self.stiffness = self.reference_stiffness(case)
        if moving.size == 0:
            self.omega = np.sqrt(self.stiffness / float(np.trace(self.structure.M)))
        base = self.excitation(case)
        self.snubbers(case, base)
        if kind == "chain" and not self.large and self.chance(0.35):
            self.bent_spring(case["chain"])
        if self.more and self.chance(0.4):
            self.friction(case, base)
        self.start(case)
        if self.chance(0.15) and not self.rigid:
            case["gravity"] = self.pick(-1.0, 1.0) * self.size * self.omega**2 * self.between(0.1, 1)
            self.features.add("gravity")
        case["probes"] = [{"name": "probe", **self.place(case)}]
        return case, self.features

    # -- bodies --------------------------------------------------------------------------------------------------------

    def chain(self, held=False):
        n = int(self.rng.integers(1, 6)) if not held else int(self.rng.integers(1, 4))
        if self.large:
            n = int(self.rng.integers(30, 81))
            self.features.add("30 to 80 modes")
        k = self.power(1, 5)
        masses = [self.power(-1, 0.5) for _ in range(n)]
        springs = [k * self.power(-0.7, 0.7) for _ in range(n + self.pick(0, 1))]
        if not held and self.chance(0.15):
            springs[0] = 0.0
            if len(springs) > n:
                springs[-1] = 0.0
        chain = {"masses": masses, "springs": springs}
        kind = self.pick("none", "dashpots", "modal", "rayleigh")
        rate = np.sqrt(k)
        if kind == "dashpots":
            chain["dashpots"] = [s and self.between(0, 0.1) * np.sqrt(s) for s in springs]
        elif kind == "modal":
            chain["damping"] = {"kind": "modal", "ratio": self.ratios()}
        elif kind == "rayleigh":
            chain["damping"] = {
                "kind": "rayleigh",
                "mass": self.between(0, 0.05) * rate,
                "stiffness": self.between(0, 0.02) / rate,
            }
        self.features |= {"chain", f"structural damping {kind}"}
        if self.chance(0.2):
            chain["springs_to_ground"] = [
                {"mass": int(self.rng.integers(1, n + 1)), "kind": "linear", "stiffness": k * self.power(-1, 0)}
            ]
            self.features.add("linear spring to the ground")
        return chain

    def ratios(self):
        if self.chance(0.3):
            return [self.between(0, 0.05) for _ in range(2)]
        return 1.0 if self.chance(0.05) else self.between(0, 0.05)

    def beam(self, held=False):
        elements = int(self.rng.integers(1, 4))
        while True:
            supports = {"left": self.pick(*SUPPORTS), "right": self.pick(*SUPPORTS)}
            loose = "free" in supports.values() and "clamped" not in supports.values()
            floating = loose or ("clamped" not in supports.values() and "pinned" not in supports.values())
            if held and floating:
                continue
            if elements == 1 and set(supports.values()) <= {"clamped", "pinned"}:
                elements = 2
            break
        beam = {"length": self.between(0.2, 2), "elements": elements, "supports": supports}
        if self.chance(0.5):
            beam |= {
                "width": 0.03,
                "thickness": beam["length"] * self.between(0.004, 0.03),
                "youngs_modulus": 7e10,
                "density": 2700.0,
            }
        else:
            beam |= {"bending_stiffness": self.power(0, 3), "mass_per_length": self.power(-1, 1)}
        kind = self.pick("none", "modal", "rayleigh", "viscous")
        if kind == "modal":
            beam["damping"] = {"kind": "modal", "ratio": self.ratios()}
        elif kind == "rayleigh":
            beam["damping"] = {"kind": "rayleigh", "mass": self.between(0, 10), "stiffness": self.between(0, 1e-4)}
        elif kind == "viscous":
            beam["damping"] = {"kind": "viscous", "coefficient": self.between(0, 5)}
        if self.chance(0.25):
            node = int(self.rng.integers(1, elements + 1))
            if node < elements or supports["right"] in ("free", "guided"):
                beam["point_masses"] = [{"position": beam["length"] * node / elements, "mass": self.power(-2, 0)}]
                self.features.add("point mass on a beam")
        self.features |= {"beam", f"supports {supports['left']}-{supports['right']}", f"structural damping {kind}"}
        return beam

    def assembly(self, case):
        """Two or three bodies, each joined to one before it, until nothing floats; some have a joint to the base."""
        makers = {"beam": self.beam, "chain": lambda: self.chain(True), "matrices": self.imported}
        while True:
            features = set(self.features)
            kinds = ["beam", *self.rng.choice(["beam", "beam", "chain", "matrices"], int(self.rng.integers(1, 3)))]
            if not self.chance(0.7):
                kinds = kinds[1:] + kinds[:1]
            case["bodies"], case["joints"] = {}, []
            for number, kind in enumerate(kinds):
                spec = {"kind": str(kind), **makers[kind]()}
                spec.pop("damping", None)
                for spring in spec.get("springs_to_ground", ()):
                    spring["name"] = f"ground_{number + 1}"
                before = list(case["bodies"])
                case["bodies"][f"body_{number + 1}"] = spec
                if before:
                    self.connect(case, self.pick(*before), f"body_{number + 1}")
            if self.chance(0.3):
                self.connect(case, self.pick(*case["bodies"]), "base")
            structure = Structure(case)
            K = structure.omega**2
            if K.min() > 1e-9 * np.median(K):
                break
            self.features = features
        self.features = {f for f in self.features if not f.startswith("structural damping")} | {f"{len(kinds)} bodies"}
        case["reduction"] = {"modes": "all"}

    def connect(self, case, first, second):
        """A joint between nodes of two bodies, or of one and the base."""
        bodies = case["bodies"]
        ends = [self.node(name, bodies[name]) for name in (first, second) if name != "base"]
        turn = all("position" in end and not self.guided(bodies, end) for end in ends)
        kind = self.pick("hinge", "spring", *(["rigid"] if turn else []))
        if second == "base":
            kind, ends = "spring", [*ends, "base"]
        joint = {"name": f"joint_{len(case['joints']) + 1}", "kind": kind, "between": ends}
        k = self.reference_stiffness(case)
        if kind == "spring":
            joint["stiffness"] = k * self.power(-1, 2)
            if self.chance(0.5):
                joint["dashpot"] = self.between(0, 0.1) * np.sqrt(joint["stiffness"])
            if self.chance(0.4):
                joint["maxwell"] = [
                    {"stiffness": k * self.power(-1, 2), "relaxation_time": self.power(-4, 0)}
                    for _ in range(int(self.rng.integers(1, 3)))
                ]
                self.features.add("joint with Maxwell branches")
        if kind != "rigid" and turn and self.chance(0.5):
            length = bodies[ends[0]["body"]]["length"]
            joint["rotational_stiffness"] = k * length**2 * self.power(-1, 1)
            joint["rotational_dashpot"] = self.between(0, 0.1) * np.sqrt(k) * length**2
            self.features.add("joint with a rotational spring")
        case["joints"].append(joint)
        self.features |= {f"joint {kind}", *(["joint to the base"] if second == "base" else [])}

    def imported(self):
        """Matrices of a random network of springs, with masses that are coupled; its first node is the base."""
        n, k = int(self.rng.integers(2, 5)), self.power(1, 5)
        K = np.zeros((n + 1, n + 1))
        for i in range(1, n + 1):
            for j in {i - 1, int(self.rng.integers(0, i))}:
                row = np.eye(n + 1)[i] - np.eye(n + 1)[j]
                K += k * self.power(-0.7, 0.7) * np.outer(row, row)
        couple = np.eye(n + 1) + 0.2 * self.rng.normal(size=(n + 1, n + 1))
        M = couple @ np.diag(10 ** self.rng.uniform(-1, 0.5, n + 1)) @ couple.T
        self.files = getattr(self, "files", 0) + 1
        spec = {"kind": "matrices", "base": {"nodes": [1], "direction": "z"}}
        for key, matrix in (("mass", M), ("stiffness", K)):
            file = self.folder / f"{key}_{self.seed}_{self.files}.mtx"
            text = "".join(f"{value!r}\n" for value in ((matrix + matrix.T) / 2).T.ravel().tolist())
            file.write_text(f"%%MatrixMarket matrix array real general\n{n + 1} {n + 1}\n{text}")
            spec[key] = {"file": str(file)}
        dofs = self.folder / f"dofs_{self.seed}_{self.files}.csv"
        dofs.write_text("node,direction\n" + "".join(f"{i},z\n" for i in range(1, n + 2)))
        self.features.add("imported matrices")
        self.imported_stiffness = k
        return {**spec, "dofs": str(dofs)}

    def joint(self, case):
        """Join the two bodies at nodes; damping is what does not depend on their modes."""
        bodies = case["bodies"]
        for spec in bodies.values():
            spec.pop("damping", None)
        ends = [self.node(name, spec) for name, spec in bodies.items()]
        turn = all("position" in end for end in ends) and not any(self.guided(bodies, end) for end in ends)
        kind = self.pick("hinge", "spring", *(["rigid"] if turn else []))
        joint = {"name": "joint", "kind": kind, "between": ends}
        if kind == "spring":
            joint["stiffness"] = self.reference_stiffness(case) * self.power(-1, 2)
            if self.chance(0.5):
                joint["dashpot"] = self.between(0, 0.1) * np.sqrt(joint["stiffness"])
        case["joints"] = [joint]
        self.features = {f for f in self.features if not f.startswith("structural damping")} | {f"joint {kind}"}

    def node(self, name, spec):
        """A mass of a chain, or a node of a beam that can move."""
        if "masses" in spec:
            return {"body": name, "mass": int(self.rng.integers(1, len(spec["masses"]) + 1))}
        if "dofs" in spec:
            return {"body": name, **self.imported_place(spec)}
        nodes = list(range(1, spec["elements"]))
        nodes += [0] if spec["supports"]["left"] in ("free", "guided") else []
        nodes += [spec["elements"]] if spec["supports"]["right"] in ("free", "guided") else []
        if not nodes:
            spec["elements"], nodes = 2, [1]
        return {"body": name, "position": spec["length"] * self.pick(*nodes) / spec["elements"]}

    def imported_place(self, spec):
        with open(spec["dofs"], encoding="utf-8") as lines:
            count = sum(1 for _ in lines) - 1
        return {"node": int(self.rng.integers(2, count + 1)), "direction": "z"}

    @staticmethod
    def guided(bodies, end):
        supports, length = bodies[end["body"]]["supports"], bodies[end["body"]]["length"]
        return supports["left" if end["position"] == 0 else "right"] == "guided" and end["position"] in (0.0, length)

    def reference_stiffness(self, case):
        """N/m, of a beam E I / L^3, of a chain its stiffest spring; of two bodies the smaller."""
        found = []
        for spec in (case.get("bodies") or {"": case.get("beam") or case["chain"]}).values():
            if "masses" in spec:
                found.append(max(spec["springs"]) or 1e3)
                continue
            if "dofs" in spec:
                found.append(self.imported_stiffness)
                continue
            bending = spec.get("bending_stiffness")
            if bending is None:
                bending = spec["youngs_modulus"] * spec["width"] * spec["thickness"] ** 3 / 12
            found.append(bending / spec["length"] ** 3)
        return min(found)

    def place(self, case, body=None):
        """A place that can move."""
        bodies = case.get("bodies")
        if bodies and body is None:
            body = self.pick(*bodies)
        spec = bodies[body] if bodies else case.get("beam") or case["chain"]
        if "masses" in spec:
            place = {"mass": int(self.rng.integers(1, len(spec["masses"]) + 1))}
        elif "dofs" in spec:
            place = self.imported_place(spec)
        else:
            ends = [at for at, side in ((1.0, "right"), (0.0, "left")) if spec["supports"][side] in ("free", "guided")]
            share = self.pick(*ends) if ends and self.chance(0.5) else self.between(0.15, 0.95)
            place = {"position": share * spec["length"]}
        return {"at": {"body": body, **place}} if bodies else place

    def moves(self, first, second):
        """Whether joints leave two places a distance that changes."""
        rows = self.structure.row(first), self.structure.row(second)
        return np.abs(rows[1] - rows[0]).max() > 1e-6 * np.abs(rows).max()

    def two_of(self, case):
        """Names of two bodies."""
        names = list(case["bodies"])
        return names if len(names) == 2 else [names[i] for i in sorted(self.rng.choice(len(names), 2, replace=False))]

    # -- inputs --------------------------------------------------------------------------------------------------------

    def excitation(self, case):
        """Add an input; returns whether the base moves."""
        kind = self.rng.choice(
            ["none", "harmonic", "multi_tone", "step", "half_sine", "swept_sine", "sampled", "random"],
            p=[0.16, 0.34, 0.1, 0.1, 0.1, 0.06, 0.07, 0.07],
        )
        self.features.add(f"input {kind}")
        f = self.omega / (2 * np.pi)
        self.duration = PERIODS / f
        if kind == "none":
            case["excitation"] = {"kind": "none"}
            return False
        base = self.chance(0.65) and kind != "swept_sine"
        self.features.add("on the base" if base else "force at a point")
        place = self.place(case)
        if self.more and not base and kind in ("harmonic", "multi_tone") and self.chance(0.5):
            return self.forces(case, f)
        case["excitation"] = spec = {"kind": str(kind), "applied_to": "base" if base else place.get("at", place)}
        a = self.size * self.omega**2 * self.between(0.3, 3)  # m/s^2
        turns = base and self.assembled and all("supports" in body for body in case["bodies"].values())
        turns = turns and all(joint["between"][1] != "base" for joint in case["joints"]) and self.chance(0.5)
        if turns:
            length = case["bodies"]["body_1"]["length"]
            spec |= {"direction": "ry", "about": length * self.between(-0.5, 1.5)}
            a /= length
            self.features.add("base that turns")
        if not base:
            row = np.abs(self.structure.row(place)).max()
            a = self.size * self.stiffness * self.between(0.3, 3) if row == 0 else a / row**2 * 0.3
        if kind in ("harmonic", "multi_tone"):
            quantity = self.pick("acceleration", "acceleration", "velocity", "displacement") if base else "force"
            power = {"velocity": 1, "displacement": 2}.get(quantity, 0)
            if base:
                angular = {"acceleration": "angular_acceleration", "velocity": "angular_velocity"}
                spec["quantity"] = angular.get(quantity, "rotation") if turns else quantity
                self.features.add(f"base {quantity}")

            def tone():
                g = f * self.power(-0.5, 1.0)
                if self.chance(0.15):
                    g = (
                        float(self.pick(*self.structure.omega[self.rigid :])) / (2 * np.pi)
                        if self.structure.omega.size > self.rigid
                        else f
                    )
                    self.features.add("input at a natural frequency")
                level = (
                    a * min(1.0, 1.0 / abs(1 - (g / f) ** 2 or 1e-3)) if g < f else a * (g / f) ** self.between(0, 1)
                )
                return {"level": level / (2 * np.pi * g) ** power, "frequency": g, "phase": self.between(-3, 3)}

            if kind == "harmonic":
                spec |= tone()
            else:
                spec["tones"] = [tone() for _ in range(int(self.rng.integers(2, 4)))]
        elif kind == "step":
            spec |= {"level": a, "time": self.pick(0.0, self.between(0, 1) / f)}
        elif kind == "half_sine":
            spec |= {
                "level": 3 * a,
                "duration": self.between(0.1, 1) / f,
                "time": self.pick(0.0, self.between(0, 1) / f),
            }
        elif kind == "swept_sine":
            low, high = f * self.between(0.3, 0.8), f * self.between(1.2, 4)
            if self.chance(0.3):
                low, high = high, low
            self.duration *= 0.8
            rate = float(abs(high - low) / (1.2 * self.duration))
            spec |= {"level": a, "from": low, "to": high, "rate": f"{rate!r} Hz/s", "phase": self.between(-3, 3)}
        elif kind == "sampled":
            self.duration *= 0.5
            time = np.arange(121) * (self.duration * 1.05 / 120)
            values = a * np.cumsum(self.rng.normal(size=121)) * np.exp(-np.arange(121) / 60)
            file = self.folder / f"input_{self.seed}.csv"
            lines = [f"{t!r},{v!r}\n" for t, v in zip(time.tolist(), (values - values.mean()).tolist(), strict=True)]
            unit = "rad/s^2" if turns else "m/s^2" if base else "N"
            file.write_text(f"time (s),value ({unit})\n" + "".join(lines))
            quantity = "angular_acceleration" if turns else "acceleration" if base else "force"
            spec |= {"file": str(file), "quantity": quantity, "time_unit": "s"}
            spec["unit"] = unit
        else:
            self.duration *= 0.5
            top = f * self.between(1.5, 3)
            density = a**2 / top
            points = [(0.3 * f, density), (f, density * self.power(-1, 0.5)), (top, density)]
            spec["psd"] = [{"frequency": x, "density": d} for x, d in points]
            spec |= {
                "seed": int(self.rng.integers(1000)),
                "period": max(1.1 * self.duration, 20.0 / f),
                "sample_rate": 6 * top,
            }
        return base

    def forces(self, case, f):
        """Two or three sines at different places."""
        found = []
        for _ in range(int(self.rng.integers(2, 4))):
            place = self.place(case)
            row = np.abs(self.structure.row(place)).max()
            level = self.size * (self.omega**2 / row**2 * 0.3 if row > 0 else self.stiffness) * self.between(0.1, 1)
            tone = {"level": level, "frequency": f * self.power(-0.5, 1.0), "phase": self.between(-3, 3)}
            found.append({"kind": "harmonic", "applied_to": place.get("at", place), **tone})
        case["excitation"] = {"kind": "forces", "forces": found}
        self.features = self.features - {"input harmonic", "input multi_tone"} | {"several forces"}
        return False

    # -- contacts ------------------------------------------------------------------------------------------------------

    def snubbers(self, case, base):
        count = int(
            self.rng.choice([3, 4] if self.large else [1, 2, 3], p=[0.5, 0.5] if self.large else [0.5, 0.35, 0.15])
        )
        found = []
        self.prestressed = False
        chain = case.get("chain")
        for i in range(count):
            link = "bodies" in case or (chain and len(chain["masses"]) > 1 and self.chance(0.3))
            snubber = {"name": f"stop_{i + 1}"}
            if link and "bodies" in case and (i == 0 or self.chance(0.5)):
                snubber["between"] = [self.place(case, body)["at"] for body in self.two_of(case)]
                while not self.moves(*snubber["between"]):
                    snubber["between"] = [self.place(case, body)["at"] for body in self.two_of(case)]
                snubber["resists"] = self.pick("approach", "separation")
            elif link and chain:
                first, second = self.rng.choice(len(chain["masses"]), 2, replace=False) + 1
                snubber |= {"between": [int(first), int(second)], "resists": self.pick("approach", "separation")}
            else:
                place = self.place(case)
                previous = found[-1] if found and "between" not in found[-1] and self.chance(0.4) else None
                if previous is not None:  # the same place from the other side
                    place = {key: previous[key] for key in ("at", "position", "mass") if key in previous}
                snubber |= place
                snubber["side"] = self.pick("below", "above")
                if previous is not None:
                    snubber["side"] = "above" if previous["side"] == "below" else "below"
                    self.features.add("both sides of one place")
                ground = base and self.chance(0.45)
                snubber["mounted_on"] = "ground" if ground else "base"
                self.features.add("on the ground" if ground else "mounted on the base")
            if "between" in snubber:
                self.features.add(f"link ({snubber['resists']})")
            ratio = self.between(SMALLEST_RATIO, LARGEST_RATIO) if self.chance(0.5) else self.between(-1, 4)
            self.features.add(f"stiffness ratio 1e{int(np.floor(ratio)):+d} to 1e{int(np.floor(ratio)) + 1:+d}")
            snubber["stiffness"] = self.stiffness * 10**ratio
            self.gap(snubber, ratio)
            self.damping(snubber)
            if self.chance(0.35):
                snubber["law"] = "no_tension"
                self.features.add("no_tension with dashpot" if "damping" in snubber else "no_tension without dashpot")
            else:
                self.features.add(
                    "kelvin_voigt with dashpot" if "damping" in snubber else "kelvin_voigt without dashpot"
                )
            if self.more and self.chance(0.5):
                self.pad(snubber)
            found.append(snubber)
        self.features.add(f"{count} snubber{'s' * (count > 1)}")
        (case["chain"] if chain else case)["snubbers"] = found

    def pad(self, snubber):
        """A table in the place of the stiffness, Maxwell branches beside it, or both; no preload."""
        k, kind = snubber["stiffness"], self.pick("table", "branches", "both")
        if "preload" in snubber:
            snubber["gap"] = -snubber.pop("preload") / k
        if snubber.get("damping", {}).get("kind") == "ratio":
            mass = float(np.trace(self.structure.M)) / len(self.structure.M)
            c = 2 * snubber["damping"]["ratio"] * np.sqrt(k * mass)
            snubber["damping"] = {"kind": "viscous", "coefficient": c}
        if kind != "branches":
            deflection = self.size * np.cumsum([0.0, *10 ** self.rng.uniform(-1.5, 0, self.rng.integers(2, 5))])
            slopes = k * 10 ** self.rng.uniform(-1, 0.5, deflection.size - 1)
            force = np.cumsum([0.0, *(slopes * np.diff(deflection))])
            snubber["force_deflection"] = np.transpose([deflection, force]).tolist()
            del snubber["stiffness"]
            self.features.add("table")
        if kind != "table":
            period = 2 * np.pi / self.omega
            snubber["maxwell"] = [
                {"stiffness": k * self.power(-1, 0.5), "relaxation_time": period * self.power(-2, 1)}
                for _ in range(int(self.rng.integers(1, 3)))
            ]
            snubber["law"] = "no_tension"
            self.features.add("Maxwell branches")

    def friction(self, case, base):
        """One or two frictions with a spring, or one that holds exactly."""
        sines = case["excitation"]["kind"] in ("none", "harmonic", "multi_tone", "forces") and not base
        springs = [*(case.get("chain") or case).get("snubbers", ()), *case.get("joints", ())]
        branches = any("maxwell" in spring for spring in springs)
        rigid = sines and not branches and self.chance(0.5)
        found = []
        for i in range(1 if rigid else int(self.rng.integers(1, 3))):
            friction = {"name": f"friction_{i + 1}"}
            if "bodies" in case and self.chance(0.4):
                friction["between"] = [self.place(case, body)["at"] for body in self.two_of(case)]
                while not self.moves(*friction["between"]):  # the package refuses what a joint leaves without effect
                    friction["between"] = [self.place(case, body)["at"] for body in self.two_of(case)]
            else:
                place = self.place(case)
                friction["at"] = place.get("at", place)
                friction["mounted_on"] = "ground" if base and self.chance(0.4) else "base"
            sliding = self.between(0.1, 0.4)
            friction["coefficient"] = {"static": sliding * self.pick(1.0, self.between(1.0, 1.6)), "sliding": sliding}
            friction["normal_force"] = self.size * self.stiffness * self.power(-2, 0.5)
            if not rigid:
                friction["stiffness"] = self.stiffness * self.power(-1, 3)
            found.append(friction)
        case["friction"] = found
        self.features.add("friction that holds exactly" if rigid else "friction behind a spring")

    def gap(self, snubber, ratio):
        kind = self.rng.choice(["zero", "backlash", "prestress", "preload"], p=[0.25, 0.4, 0.25, 0.1])
        if kind == "preload" and self.rigid:
            kind = "zero"
        if kind == "zero":
            snubber["gap"] = 0.0
        elif kind == "backlash":
            snubber["gap"] = self.size * self.power(-2, 0.2)
        elif kind == "prestress":
            snubber["gap"] = -self.size * self.power(-2, 0) / max(1.0, 10 ** (ratio - 4))
            self.prestressed = True
        else:
            snubber["preload"] = self.size * self.stiffness * self.power(-2, 0) * min(1.0, 10**ratio)
            self.prestressed = True
        self.features.add(f"gap: {kind}")

    def damping(self, snubber):
        kind = self.rng.choice(["none", "ratio", "viscous"], p=[0.45, 0.35, 0.2])
        if kind == "ratio":
            large = self.chance(0.15)
            snubber["damping"] = {
                "kind": "ratio",
                "ratio": self.between(0.3, 1.5) if large else self.between(0.005, 0.2),
            }
        elif kind == "viscous":
            mass = float(np.trace(self.structure.M)) / len(self.structure.M)
            c = 2 * self.between(0.005, 0.1) * np.sqrt(snubber["stiffness"] * mass)
            snubber["damping"] = {"kind": "viscous", "coefficient": c}

    def bent_spring(self, chain):
        """A piecewise-linear spring."""
        bends = np.unique(self.size * np.sort(self.rng.normal(size=self.rng.integers(1, 4))))
        if self.chance(0.15):
            bends[self.rng.integers(bends.size)] = 0.0
        bends = np.unique(bends)
        slopes = (
            self.stiffness * 10 ** self.rng.uniform(-1, 1.5, bends.size + 1) * (self.rng.random(bends.size + 1) > 0.15)
        )
        spring = {"kind": "piecewise_linear", "breakpoints": bends.tolist(), "stiffnesses": slopes.tolist()}
        n = len(chain["masses"])
        if n > 1 and self.chance(0.5):
            pair = sorted(int(x) + 1 for x in self.rng.choice(n, 2, replace=False))
            chain["springs_between"] = [{"name": "bent", "masses": pair, **spring}]
        else:
            found = chain.setdefault("springs_to_ground", [])
            found.append({"name": "bent", "mass": int(self.rng.integers(1, n + 1)), **spring})
        self.features.add("piecewise_linear")

    # -- start ---------------------------------------------------------------------------------------------------------

    def start(self, case):
        """A start that exists: an equilibrium only where the structure is held."""
        spec = case.get("beam") or case.get("chain")
        free = case["excitation"]["kind"] == "none"
        kinds = ["rest"] if not free or self.prestressed else []
        if not self.rigid:
            kinds.append("released_force" if free else "static_equilibrium")
            kinds += ["released_force"]
        if spec is not None and self.fields(spec) is not None:
            kinds += ["moving", "moving"]
        kind = self.pick(*kinds) if kinds else "rest"
        self.features.add(f"start {kind}")
        run = case.setdefault("run", {})
        if kind in ("rest", "static_equilibrium"):
            run["start"] = kind
        elif kind == "released_force":
            place = self.place(case)
            row = self.structure.row(place)
            soft = float(np.sum(row[self.rigid :] ** 2 / self.structure.omega[self.rigid :] ** 2))
            run["start"] = {
                "released_force": {**place, "force": self.pick(-1.0, 1.0) * self.size / soft * self.between(0.3, 2)}
            }
        else:
            speed = self.size * self.omega
            run["start"] = {"velocity": self.fields(spec, speed)}
            if self.chance(0.5):
                run["start"]["displacement"] = self.fields(spec, self.size)

    def fields(self, spec, size=1.0):
        """A random initial field of a size that the body allows: a list, or a polynomial within its elements."""
        if "masses" in spec:
            return (size * self.rng.normal(size=len(spec["masses"]))).tolist()
        left, right, L = spec["supports"]["left"], spec["supports"]["right"], spec["length"]
        if right != "free":
            if left == right == "pinned":
                return [0.0, size * 4 / L, -size * 4 / L**2]
            if {left, right} == {"guided"}:
                return [size]
            return None
        powers = {"clamped": (2, 3), "pinned": (1, 3), "guided": (0, 2, 3), "free": (0, 1, 2, 3)}[left]
        field = np.zeros(4)
        for p in powers:
            field[p] = size * self.rng.normal() / L**p
        return field.tolist()
