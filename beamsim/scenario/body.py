"""What every kind of body answers about itself, and what sits on bodies."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path as FilePath
from typing import TYPE_CHECKING, Any, ClassVar, NamedTuple, Self

from beamsim.errors import Problem
from beamsim.scenario.base import Path, Schema, path_text, problem
from beamsim.scenario.place import AtPlace, Point, Where
from beamsim.scenario.quantities import Share


class Located(NamedTuple):
    """A snubber or spring, where it is written, the body it means where it names none, and all bodies."""

    path: Path
    body: str
    item: Any
    sections: Mapping[str, Body]

    @property
    def bodies(self) -> tuple[str, ...]:
        """The bodies that it acts on, each once."""
        return tuple(dict.fromkeys(place.body or self.body for place in self.item.places))


class Body(Schema):
    """One body of a scenario; a kind of body is a subclass.

    What is here holds for a body without snubbers, springs or ends of its own; ``where`` is the path of the body.
    """

    body_kind: ClassVar[str] = ""
    """Which assembly is its own, see `beamsim.structures.assembly`."""

    if TYPE_CHECKING:
        damping: Any  # every kind of body has its own sort of it

    how_to_place: ClassVar[str] = "give a position on the beam, position: 270 mm"
    """How a place of it is named."""

    has_slope: ClassVar[bool] = False
    """Whether its points turn as well as deflect."""

    base_directions: ClassVar[tuple[str, ...]] = ("z",)
    """Directions in which a motion of the base, or gravity, moves its points; first what no direction means, empty
    where the body names it."""

    has_default_probe: ClassVar[bool] = True
    """Whether `default_probe` names a place."""

    is_read_from_files: ClassVar[bool] = False
    """Whether files that the body names hold its matrices."""

    reduced_by_default: ClassVar[bool] = True
    """Whether it has modes that are left out unless they are asked for."""

    @property
    def called(self) -> str:
        """What it is, in messages."""
        return "imported matrices" if self.is_read_from_files else f"a {self.body_kind}"

    @property
    def mode_count(self) -> int | None:
        """Number of modes there are; None where that is for the mesh to say."""
        return None

    @property
    def gives_stress(self) -> bool:
        """Whether a bending stress can be recovered."""
        return False

    @property
    def gives_strain(self) -> bool:
        """Whether a strain of its surface can be recovered."""
        return self.gives_stress

    @property
    def recovered_rows(self) -> tuple[str, ...]:
        """Names of other quantities that it gives."""
        return ()

    @property
    def rough_frequency_hz(self) -> float:
        """Order of magnitude of a low natural frequency, Hz."""
        return 0.0

    def refined(self) -> Self:
        """The body with twice the elements; itself where it has no mesh of its own."""
        return self

    @property
    def largest_deflection(self) -> float:
        """Deflection above which theory for small ones no longer holds, m."""
        return math.inf

    @property
    def largest_gap(self) -> float:
        """Gap, or prestress, of a snubber above which a factor is likely to be wrong, m."""
        return math.inf

    @property
    def own_snubbers(self) -> tuple[Any, ...]:
        """Snubbers listed in the body itself, under ``snubbers``."""
        return ()

    def own_names(self) -> list[tuple[Path, tuple[Any, ...]]]:
        """Lists below the body whose items share one set of names."""
        return []

    def nonlinear_springs(self) -> list[tuple[Path, Any]]:
        """Springs of the body with a law of their own, with their paths below the body."""
        return []

    @property
    def marks(self) -> tuple[tuple[float, str], ...]:
        """Coordinates and kinds of what a sketch shows on the body: clamped, pinned, guided, springs, mass."""
        return ()

    @property
    def depths(self) -> tuple[tuple[float, float, float], ...]:
        """Stretches of the body whose depth is known: first and last coordinate, and the depth, m."""
        return ()

    @property
    def spring_links(self) -> tuple[tuple[float | None, float | None], ...]:
        """Pairs of coordinates that springs of the body join; None is the wall before the first or after the last."""
        return ()

    def default_probe(self) -> tuple[str, AtPlace]:
        """Name and place of the probe where nothing else tells one."""
        raise NotImplementedError

    @property
    def sides(self) -> tuple[float, ...]:
        """Lengths, m, along which positions on the body are measured."""
        return ()

    def metres(self, position: float | Share, axis: int = 0) -> float:
        """A position along a side in m; at its end where it is beyond it by round-off only (3 ft and 36 in differ)."""
        if axis >= len(self.sides):
            return math.nan if isinstance(position, Share) else position
        side = self.sides[axis]
        if isinstance(position, Share):
            return side * position.value
        return side if side < position <= side * (1.0 + 1e-12) else position

    def point(self, position: Where) -> Point:
        """A position on the body in m, of a share that of the side."""
        if not isinstance(position, tuple):
            return self.metres(position)
        return self.metres(position[0], 0), self.metres(position[1], 1)

    def point_of(self, place: AtPlace) -> Point:
        """The position of a place on the body in m, or the number of the mass or node."""
        if place.position is not None:
            return self.point(place.position)
        number = place.mass if place.node is None else place.node
        assert number is not None
        return float(number)

    def holds(self, position: Where) -> bool:
        """Whether nothing can deflect at a position."""
        return False

    def problems(self, where: Path) -> Iterator[Problem]:
        """What is wrong with the body by itself."""
        yield from ()

    def position_problems(self, where: Path, at: Path, position: Where, what: str) -> Iterator[Problem]:
        """What is wrong with a position on the body; ``what`` does nothing on a support, and is empty for what may."""
        yield self._misplaced(where, at, "a beam")

    def mass_problems(self, where: Path, at: Path, mass: int) -> Iterator[Problem]:
        """What is wrong with the number of a mass of the body."""
        yield self._misplaced(where, at, "a chain")

    def node_problems(self, where: Path, at: Path) -> Iterator[Problem]:
        """Why a node is not a place of the body."""
        yield self._misplaced(where, at, "imported matrices")

    def _misplaced(self, where: Path, at: Path, of: str) -> Problem:
        """That a place is named as on bodies of another kind."""
        this = "the structure" if len(where) == 1 else path_text(where)
        return problem(at, f"applies to {of}, but {this} is {self.called}", self.how_to_place)

    def shape_problems(self, where: Path, at: Path, position: float) -> Iterator[Problem]:
        """What is wrong with a position at which a mode shape was measured."""
        yield from self.position_problems(where, at, position, "")

    def in_folder(self, folder_of: Callable[..., FilePath]) -> Self:
        """The body with the files that it names where they are; ``folder_of`` tells the folder of a key's file."""
        return self

    def movable_problems(self, where: Path, at: Path, position: float) -> Iterator[Problem]:
        """Why no snubber can move to a position of the body, written at ``at``; by default that it is no beam."""
        message = f"= position moves along a beam, but the structure is {self.called}"
        yield problem((*at[:-1], "kind"), message, "follow gap or stiffness, or vary the place in a study")

    def power_of_start(self, index: int) -> int:
        """Power of x whose coefficient is the number of a displacement or velocity to start from."""
        return index

    def start_problems(self, where: Path, at: Path, numbers: tuple[float, ...]) -> Iterator[Problem]:
        """What is wrong with the numbers of a displacement or velocity to start from; by default that there are any."""
        if numbers:
            remedy = "start from rest, the static equilibrium, a mode, or a released force"
            yield problem(at, f"gives a shape of a beam or chain, but the structure is {self.called}", remedy)

    def factor_problems(self, where: Path, key: str, largest: float) -> Iterator[Problem]:
        """Springs that a stiffness factor up to ``largest`` would give a negative slope."""
        yield from ()

    def point_force_doubts(self, where: Path, position: Where) -> Iterator[str]:
        """A sentence where a force at a point, written at ``where``, makes a result doubtful."""
        yield from ()

    def doubts(self, where: Path, highest_hz: float) -> Iterator[str]:
        """A sentence for each doubtful number; the excitation goes up to ``highest_hz``."""
        yield from ()
