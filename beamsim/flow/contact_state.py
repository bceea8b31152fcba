"""The closed-form flow of one contact state, tabulated for the kernels.

With every contact in one phase of its law, every quantity of the motion on a segment is a combination of a
few basis functions :math:`\\tau^p e^{\\lambda\\tau}`. A *term* says which source (a free modal amplitude, or the
amplitude of an input) multiplies which basis function and which state vector:

.. math:: y(\\tau) = \\mathrm{Re} \\sum_t u_t\\, \\zeta_{src(t)}\\, \\tau^{p(t)} e^{\\lambda(t)\\tau}.

The state vector y holds the coordinates, their rates and the contact laws' internal states, N = 2n + r.
Sources are numbered: inputs 0 … F-1, free amplitudes from F.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import NamedTuple

import numpy as np

from beamsim.contacts.laws import PENETRATION, RATE
from beamsim.flow.invariant_blocks import (
    Block,
    BlockForm,
    SimpleModes,
    block_diagonalise,
    neighbouring_modes,
    second_order_blocks,
)
from beamsim.inputs.signal import Sources
from beamsim.system.equations import PiecewiseLinearSystem, StateEquations
from beamsim.typing import TINY, Bools, Complexes, Floats, Ints

GROWN = 3.0  # logarithm of the largest growth within a segment
GROWTH = 600.0  # logarithm of a function's growth; where it is larger, the amplitude is zero
SMALLEST_TERM = 1e-19  # relative size at which a power series is cut


@dataclass(frozen=True)
class ContactState:
    """One contact state: its equations and modes, and under given inputs the tables for the kernels.

    There are B basis functions, T terms and Z free amplitudes.
    """

    equations: StateEquations
    phases: Ints  # (m,) of the contacts
    modes: BlockForm  # simple ones, one of each conjugate pair, and blocks of the others
    horizon: float  # s, longest segment for which series hold
    exponent: Complexes  # (B,)
    power: Ints  # (B,)
    exponential: bool  # whether no basis function has a power of time
    projector: Complexes  # (Z, N) free amplitudes = projector @ (y - y_forced(0))
    term_basis: Ints  # (T,)
    term_source: Ints  # (T,)
    term_vector: Complexes  # (T, N)
    basis_of_source: Ints  # (F,) the basis function of each input
    # (F,) the term in which each input drives its own basis function, and the one a power lower (-1: none)
    terms_of_sources: tuple[Ints, Ints]
    forced_at_start: Complexes  # (F, N) state at the start of a piece that a unit of each input forces
    drive: Drive | None = None  # kept once loads have changed

    @classmethod
    def of(
        cls, equations: StateEquations, sources: Sources, longest_window: float, neighbour: ContactState | None = None
    ) -> ContactState:
        """Diagonalise the system with its contacts in given phases.

        Cost: one symmetric eigenvalue problem of order n and, where damping or internal states couple modes, one
        unsymmetric of the order of these; none from a ``neighbour`` state with few other phases where
        :func:`beamsim.flow.invariant_blocks.neighbouring_modes` is exact.

        Parameters
        ----------
        equations : of the contact state.
        sources : of the inputs.
        longest_window : upper limit on the length of a segment, s.
        neighbour : a contact state of the same system.

        Returns
        -------
        ContactState
        """
        eq, modes = equations.equations, None if neighbour is None else _modes_from_neighbour(neighbour, equations)
        if modes is None:
            modes = _solved_modes(equations, longest_window)
        if eq.contacts.internal_states and not eq.contacts.couples_states(equations.phases):
            internal = block_diagonalise(equations.internal_rates[:, eq.internal], longest_window)
            modes = modes.join(internal.transform(np.eye(eq.states)[:, eq.internal], np.eye(eq.states)[eq.internal]))
        right, left, lam = modes.simple
        upper = np.flatnonzero(lam.imag >= 0.0)
        modes = BlockForm(SimpleModes(right[:, upper], left[upper], lam[upper]), modes.blocks)
        # series hold within a radius; what grows is bounded by its end, so that a segment ends before that is far above
        growing = [*lam.real.tolist(), *(complex(b.centre).real for b in modes.blocks)]
        fastest = max([0.0, *(b.radius for b in modes.blocks), *(rate / GROWN for rate in growing)])
        horizon = float(min(longest_window, 1.0 / fastest if fastest > 0 else np.inf))
        return _tables_of_state(
            equations, modes, horizon, sources, responses(Drive.of(equations, modes, horizon), sources)
        )

    def with_loads(self, sources: Sources) -> ContactState:
        """The same state under other signals of the same channels.

        If each input's forced motion contains only the time function of that input, before and now, only the first F
        terms (one per input) are recomputed. Otherwise all terms are listed again.
        """
        drive = self.drive or Drive.of(self.equations, self.modes, self.horizon)
        forced, F = responses(drive, sources), sources.power.size
        if forced.shape[1] == 1 and self.exponential and self.term_basis.size == F + self.projector.shape[0]:
            exponent, vectors = self.exponent.copy(), self.term_vector.copy()
            expected = np.append(sources.exponent, exponent[self.term_basis[F:]])  # of the terms
            exponent[self.term_basis[:F]], vectors[:F] = sources.exponent, forced[:, 0]
            if np.array_equal(exponent[self.term_basis], expected):  # the same terms share functions
                at_start = forced[:, 0]
                return replace(self, exponent=exponent, term_vector=vectors, forced_at_start=at_start, drive=drive)
        return replace(_tables_of_state(self.equations, self.modes, self.horizon, sources, forced), drive=drive)

    def coefficients(self, rows: Floats, sources: Sources) -> Complexes:
        """Factors of ``zeta * basis`` of every term in every output.

        Parameters
        ----------
        rows : (k, V) the outputs in this contact state.
        sources : of the loads.

        Returns
        -------
        (T, k).
        """
        table = np.empty((self.term_vector.shape[0], rows.shape[0]), dtype=complex)
        eq = self.equations.equations
        states, inputs, slopes = rows[:, : eq.states], rows[:, eq.inputs], rows[:, eq.slopes]
        table.real, table.imag = self.term_vector.real @ states.T, self.term_vector.imag @ states.T
        direct, lower = self.terms_of_sources
        table[direct] += (inputs + sources.exponent * slopes).T
        if sources.power.any():
            powers = sources.power > 0
            table[lower[powers]] += (sources.power * slopes)[:, powers].T
        return table

    def terms_after(self, zeta: Complexes, tau: Floats) -> Complexes:
        """(n, T) terms at times tau (n,) after those at which the amplitudes are zeta (n, F + Z)."""
        index = np.arange(self.exponent.size)
        functions = self.exponentials_after(tau, index)
        if not self.exponential:
            functions *= self.powers_after(tau, index)
        return zeta.take(self.term_source, axis=1) * functions.take(self.term_basis, axis=1)

    def exponentials_after(self, tau: Floats, functions: Ints) -> Complexes:
        """(n, b) exponentials of some of the functions ``tau^power e^(exponent tau)`` at times tau (n,)."""
        power = np.multiply.outer(tau, self.exponent[functions])
        return np.exp(np.where(power.real < GROWTH, power, 0.0))

    def powers_after(self, tau: Floats, functions: Ints) -> Floats:
        """(n, b) powers of some of the functions at times tau (n,)."""
        return np.vander(tau, int(self.power.max()) + 1, increasing=True)[:, self.power[functions]]

    def amplitudes(self, input_amplitudes: Complexes, y: Floats) -> Complexes:
        """(n, F + Z) amplitudes of the inputs (n, F), then those of the free motions in states y (n, N)."""
        free = y - (input_amplitudes @ self.forced_at_start).real
        return np.concatenate([input_amplitudes, free @ self.projector.T], axis=1)

    def amplitude_noise(self, input_amplitudes: Complexes, y: Floats) -> Floats:
        """(n, F + Z) round-off of the amplitudes; zero for the inputs, see `amplitudes`."""
        sizes = np.abs(y) + np.abs(input_amplitudes) @ np.abs(self.forced_at_start)
        noise = np.finfo(float).eps * sizes @ np.abs(self.projector.T)
        return np.concatenate([np.zeros(input_amplitudes.shape), noise], axis=1)

    def roundoff_scale(self, rows: Floats, coefficients: Complexes) -> Floats:
        """(T, k) bound on the summands of each term's coefficient before they cancel, for outputs with rows (k, V).

        At a node of all moving modes the coefficients are round-off themselves; these products of norms are not.
        """
        size, equations = np.abs(coefficients), self.equations.equations
        parts = (equations.coordinates, equations.velocities, equations.internal)
        for part in parts if equations.contacts.internal_states else parts[:2]:
            vector, row = self.term_vector[:, part], rows[:, part]
            length = np.sqrt((vector.real**2 + vector.imag**2).sum(axis=1))
            size = np.maximum(size, length[:, None] * np.sqrt((row**2).sum(axis=1)))
        return np.ascontiguousarray(size)


def _tables_of_state(
    equations: StateEquations, modes: BlockForm, horizon: float, sources: Sources, input_responses: Complexes
) -> ContactState:
    """The tables of a contact state: the responses (F, D, N) to the sources, and the free motion."""
    (X, Xi, lam), F, rising = modes.simple, sources.power.size, np.flatnonzero(sources.power)
    index = np.arange(F)
    exists: Bools = np.asarray(input_responses.any(axis=2))
    exists[index, sources.power] = exists[rising, sources.power[rising] - 1] = True
    (of_source, power), basis = exists.nonzero(), dict[tuple[complex, int], int]()
    keys = [*zip(sources.exponent[of_source].tolist(), power.tolist(), strict=True), *((x, 0) for x in lam.tolist())]
    term_basis = [basis.setdefault(key, len(basis)) for key in keys]
    term_source = [*of_source.tolist(), *range(F, F + lam.size)]
    vectors = [input_responses[of_source, power], X.T * np.where(lam.imag > 0.0, 2.0, 1.0)[:, None]]
    window = min(horizon, float(sources.longest_piece.max()))
    for key, source, rows in _terms_of_blocks(modes.blocks, F + lam.size, window) if modes.blocks else ():
        term_basis += [basis.setdefault(key, len(basis))] * source.size
        term_source += source.tolist()
        vectors.append(rows)
    number = np.cumsum(exists).reshape(exists.shape) - 1  # of the terms of sources
    lower = np.full(F, -1)
    lower[rising] = number[rising, sources.power[rising] - 1]
    direct = number[index, sources.power]
    exponent, powers = zip(*basis, strict=True)
    return ContactState(
        equations, equations.phases, modes, horizon,
        exponent=np.array(exponent, dtype=complex),
        power=np.array(powers, dtype=np.int64),
        exponential=not any(powers),
        projector=np.ascontiguousarray(np.concatenate([Xi, *(block.left for block in modes.blocks)])),
        term_basis=np.array(term_basis, dtype=np.int64),
        term_source=np.array(term_source, dtype=np.int64),
        term_vector=np.concatenate(vectors),
        basis_of_source=np.array(term_basis, dtype=np.int64)[direct],
        terms_of_sources=(direct, lower),
        forced_at_start=np.ascontiguousarray(input_responses[:, 0]),
    )  # fmt: skip


def _terms_of_blocks(
    blocks: Sequence[Block], first: int, window: float
) -> Iterator[tuple[tuple[complex, int], Ints, Complexes]]:
    """The free motion of blocks, by basis functions: exponent and power, sources (t,) and vectors (t, N) of the terms.

    Parameters
    ----------
    blocks : of the contact state.
    first : source of the first of them.
    window : s, for which the series of a block must hold.
    """
    for block in blocks:
        for p, matrix in enumerate(_series(block, window)):
            used = np.flatnonzero(matrix.any(axis=0))
            yield (block.centre, p), first + used, block.weight * (block.right @ matrix[:, used]).T
        first += block.matrix.shape[0]


class Drive(NamedTuple):
    """Rates of the state that unit inputs cause in a contact state; they do not depend on the signals."""

    equations: StateEquations
    modes: BlockForm  # both of each conjugate pair
    horizon: float  # s, see `ContactState.horizon`
    inputs: Floats  # (F, N) rate of the state for a unit of each input
    slopes: Floats  # (F, N) the same of their slopes

    @classmethod
    def of(cls, equations: StateEquations, modes: BlockForm, horizon: float) -> Drive:
        """From the modes of a contact state, of which each conjugate pair is given by one mode."""
        (right, left, lam), eq = modes.simple, equations.equations
        pair = np.flatnonzero(lam.imag > 0.0)
        pairs = SimpleModes(
            np.hstack([right, right[:, pair].conj()]), np.vstack([left, left[pair].conj()]),
            np.append(lam, lam[pair].conj()),
        )  # fmt: skip
        rates = equations.rates
        return cls(equations, BlockForm(pairs, modes.blocks), horizon, rates[:, eq.inputs].T, rates[:, eq.slopes].T)


def responses(drive: Drive, sources: Sources) -> Complexes:
    """The forced motion for a unit of each source: its factors of ``tau^p e^{nu_f tau}``.

    Parameters
    ----------
    drive : of the contact state.
    sources : F of them, of the inputs.

    Returns
    -------
    (F, D, N), for the powers p of time below D.
    """
    power, equations = sources.power, drive.equations
    longest = np.minimum(drive.horizon, sources.longest_piece)
    driving = (drive.inputs + sources.exponent[:, None] * drive.slopes)[:, None]
    if power.any():
        driving = _driving_in_powers(driving[:, 0], drive.slopes, power)
    forced = _forced_responses(drive.modes, driving, sources, longest)
    if not equations.factors[:, : RATE + 1].any():
        return forced
    # refine once: in slow motions the response to the load of a stiff contact is a small difference
    corrected = _forced_responses(drive.modes, _residual(forced, equations, sources), sources, longest)
    return forced + corrected if forced.shape == corrected.shape else _sum_of_polynomials(forced, corrected)


def _driving_in_powers(by_inputs: Complexes, by_slopes: Floats, power: Ints) -> Complexes:
    """(F, degree + 1, N) polynomial coefficients of the loads on the states, for sources with powers of time."""
    index, rising = np.arange(power.size), np.flatnonzero(power)
    driving = np.zeros((power.size, power.max() + 1, by_inputs.shape[1]), dtype=complex)
    driving[index, power], driving[rising, power[rising] - 1] = by_inputs, (power[:, None] * by_slopes)[rising]
    return driving


def _sum_of_polynomials(first: Complexes, second: Complexes) -> Complexes:
    """(F, D, N) sum of two polynomials in time of different degree."""
    total = np.zeros((first.shape[0], max(first.shape[1], second.shape[1]), first.shape[2]), dtype=complex)
    total[:, : first.shape[1]] = first
    total[:, : second.shape[1]] += second
    return total


def _forced_responses(modes: BlockForm, polynomial: Complexes, sources: Sources, longest: Floats) -> Complexes:
    """The responses to ``sum_p polynomial[f, p] tau^p e^{nu_f tau}``, as `responses`.

    Where ``|nu - lambda|`` times the time for which a response must hold is below a limit it is a power series that
    starts from zero.

    Parameters
    ----------
    modes : both of each conjugate pair.
    polynomial : (F, degree + 1, N).
    sources : all F.
    longest : (F,) s, for which each response must hold.
    """
    (X, left, lam), forced = modes.simple, np.empty_like(polynomial)
    beta, distance = polynomial @ left.T, sources.exponent[:, None] - lam
    near = np.abs(distance) * longest[:, None] < sources.limit[:, None]
    w = np.zeros_like(beta[:, 0])
    series = bool(modes.blocks) or bool(near.any())
    if series:
        near &= np.asarray(polynomial.any(axis=(1, 2)))[:, None]  # an input without a load needs no series
        distance[near | (distance == 0.0)] = np.inf
    for p in range(beta.shape[1] - 1, -1, -1):
        w = (beta[:, p] - (p + 1) * w) / distance
        forced[:, p] = w @ X.T
    return _with_series(forced, modes, polynomial, sources, longest, near) if series else forced


def _with_series(
    factors: Complexes, modes: BlockForm, polynomial: Complexes, sources: Sources, longest: Floats, near_exponent: Bools
) -> Complexes:
    """Add the responses of blocks, and of modes whose eigenvalue is near an exponent, as power series.

    Parameters
    ----------
    factors : (F, degree + 1, N) the responses of other modes.
    modes, polynomial, sources, longest : as for `_forced_responses`.
    near_exponent : (F, modes) whether an eigenvalue is near the exponent, of the sources that act.
    """
    X, left, lam = modes.simple
    acting = np.flatnonzero(polynomial.any(axis=(1, 2)))
    window, limit, beta, near_exponent = (
        longest[acting],
        sources.limit[acting],
        polynomial[acting] @ left.T,
        near_exponent[acting],
    )
    series: list[tuple[int, int, Complexes]] = []  # input, power of time, factor
    for a in range(acting.size) if modes.blocks else np.flatnonzero(near_exponent.any(axis=1)).tolist():
        f, close = int(acting[a]), near_exponent[a] & beta[a].any(axis=0)
        nu, load = complex(sources.exponent[f]), polynomial[f, : int(sources.power[f]) + 1]
        if close.any():
            terms = _power_series(np.diag(lam[close] - nu), beta[a, : load.shape[0], close], float(window[a]))
            series += [(f, power, X[:, close] @ v) for power, v in terms]
        for block in modes.blocks:
            answer = _response_of_block(block, load, nu, float(window[a]), float(limit[a]))
            series += [(f, power, vector) for power, vector in answer]
    powers = 1 + max((power for _, power, _ in series), default=0)
    factors = np.pad(factors, ((0, 0), (0, max(0, powers - factors.shape[1])), (0, 0))) if series else factors
    for f, power, vector in series:
        factors[f, power] += vector
    return factors


def _modes_from_neighbour(nearest: ContactState, equations: StateEquations) -> BlockForm | None:
    """The modes of a contact state from those of a state that differs in few phases; None if that is not exact."""
    eq = equations.equations
    neighbour = neighbouring_modes(eq.system, nearest.modes.simple, nearest.phases, equations.phases)
    if neighbour is None:
        return None
    modes, n, N = BlockForm(neighbour, []), eq.system.size, eq.states
    return modes if 2 * n == N else modes.transform(np.eye(N, 2 * n), np.eye(2 * n, N))


class _ActiveContacts(NamedTuple):
    """The contacts whose forces depend on the motion."""

    shape: Floats  # (a, n)
    stiffness: Floats  # (a,) N/m
    dashpot: Floats  # (a,) N s/m
    force_direction: (
        Floats  # (a, n) direction of the forces; that of `shape` but where a contact presses others that rub
    )
    contact: Ints  # (a,)
    nonsymmetric: (
        bool  # whether contact forces are not along the contact's deflection, so that the matrix is not symmetric
    )


def _solved_modes(equations: StateEquations, window: float) -> BlockForm:
    """Modes of a contact state: undamped ones in closed form, those coupled by damping or internal states numerically.

    Internal states are included if they are coupled with the structure.
    """
    system, contacts, phases = equations.equations.system, equations.equations.contacts, equations.phases
    n, N = system.size, equations.equations.states
    k, c = equations.factors[:, [PENETRATION, RATE]].T
    active, pressed = np.flatnonzero((k != 0.0) | (c != 0.0)), contacts.presses(phases)
    shape = contacts.shape[active]
    pushes = contacts.sign[active, None] * equations.push[active] if pressed else shape
    acting = _ActiveContacts(shape, k[active], c[active], pushes, active, pressed)
    fixed = equations.stuck_directions if equations.stuck_directions.shape[1] else None
    undamped = _undamped_modes(system, acting, fixed)
    if pressed or contacts.couples_states(phases):
        return _general_modes(equations, acting, undamped, window, fixed)
    omega2, psi, extension, d = undamped
    rest = np.abs(d - np.diag(np.diag(d)))
    # a mode of negative stiffness grows, which oscillators do not
    coupled = (rest.max(axis=1, initial=0.0) > 1e-14 * np.abs(d).max(initial=0.0)) | (omega2 < 0.0)
    free, mixed = np.flatnonzero(~coupled), np.flatnonzero(coupled)
    modes = second_order_blocks(psi[:, free], omega2[free], np.diag(d)[free], window)
    if 2 * n < N:
        modes = modes.transform(np.eye(N, 2 * n), np.eye(2 * n, N))
    if mixed.size:
        part = _UndampedModes(omega2[mixed], psi[:, mixed], extension[:, mixed], d[np.ix_(mixed, mixed)])
        modes = modes.join(_coupled_modes(part, N, window))
    return modes if fixed is None else _joined_with_rest(modes, equations, acting, (omega2, psi), fixed)


def _joined_with_rest(
    modes: BlockForm,
    equations: StateEquations,
    active: _ActiveContacts,
    undamped: tuple[Floats, Floats],
    constrained: Floats,
) -> BlockForm:
    """Modes of a state in which contacts hold some motions at rest, including those constrained motions.

    Parameters
    ----------
    modes : of the other motions.
    equations, active : of the contact state, and its contacts.
    undamped : squared frequencies (e,) and shapes (n, e) of the other motions.
    constrained : (n, c) motions that contacts hold at rest; the other motions stay in equilibrium for any value of
        them.
    """
    system, (omega2, psi) = equations.equations.system, undamped
    n, N = system.size, equations.equations.states
    load = system.stiffness[:, None] * constrained + (active.shape.T * active.stiffness) @ (active.shape @ constrained)
    compliance = np.divide(1.0, omega2, out=np.zeros_like(omega2), where=omega2 > 0.0)
    reply = (psi * compliance) @ (psi.T @ load)
    change, fixed = np.eye(N), np.eye(N, n) @ constrained
    change[:n, :n] += reply @ constrained.T
    right, left = np.eye(N, n) @ (constrained - reply), fixed.T
    at_rest = SimpleModes(right.astype(complex), left.astype(complex), np.zeros(constrained.shape[1], complex))
    return modes.transform(np.eye(N), change).join(BlockForm(at_rest, []))


class _FirstOrder(NamedTuple):
    """r modes in first-order form z' = A z, where z holds their scaled coordinates and the rates."""

    scale: Floats  # (r,) 1/s, from metres to velocities
    A: Floats  # (2 r, 2 r) 1/s
    to_state: Floats  # (N, 2 r) state for a unit of z
    from_state: Floats  # (2 r, N) z of a state

    @classmethod
    def of(cls, undamped: _UndampedModes, states: int) -> _FirstOrder:
        """First-order form of undamped modes within a state vector of length ``states``."""
        omega2, psi, _, d = undamped
        n, r = psi.shape
        # masses that only dashpots connect have no frequency
        fastest = np.abs(omega2).max(initial=0.0) or (d**2).max(initial=0.0) or 1.0
        scale = np.sqrt(np.maximum(np.abs(omega2), 1e-6 * fastest))
        A = np.block([[np.zeros((r, r)), np.diag(scale)], [-np.diag(omega2 / scale), -d]])
        out, back = np.zeros((states, 2 * r)), np.zeros((2 * r, states))
        out[:n, :r], out[n : 2 * n, r:] = psi / scale, psi
        back[:r, :n], back[r:, n : 2 * n] = psi.T * scale[:, None], psi.T
        return cls(scale, A, out, back)


def _inverse_of_rates(undamped: _UndampedModes, scale: Floats) -> Floats:
    """Inverse of the matrix of `_FirstOrder`, whose displacements have scales (r,); no mode is that of a rigid body."""
    compliance = scale / undamped.omega_squared
    left = -compliance[:, None] * undamped.damping / scale
    return np.block([[left, -np.diag(compliance)], [np.diag(1.0 / scale), np.zeros(undamped.damping.shape)]])


def _coupled_modes(undamped: _UndampedModes, states: int, window: float) -> BlockForm:
    """Modes that damping couples, in a state vector of so many states, for times up to the window, s."""
    scale, A, out, back = _FirstOrder.of(undamped, states)
    inverse = partial(_inverse_of_rates, undamped, scale) if undamped.omega_squared.min() > 0.0 else None
    return block_diagonalise(A, window, inverse).transform(out, back)


def _general_modes(
    equations: StateEquations,
    active: _ActiveContacts,
    undamped: _UndampedModes,
    window: float,
    constrained: Floats | None,
) -> BlockForm:
    """Modes that are coupled by internal states, or by contact forces that are not along the contact's deflection.

    Parameters
    ----------
    equations, active : of the contact state, and its contacts.
    undamped : all r modes.
    window : s, longest time for which the blocks will be used.
    constrained : (n, c) motions that contacts hold at rest, whose values load modes and internal states; None if there
        are none.
    """
    system, contacts = equations.equations.system, equations.equations.contacts
    n, together = system.size, contacts.couples_states(equations.phases)
    count, fixed = contacts.internal_states if together else 0, 0 if constrained is None else constrained.shape[1]
    _, psi, extension, _ = undamped
    scale, A, out, back = _FirstOrder.of(undamped, equations.equations.states)
    r, first = scale.size, 2 * scale.size + count
    typical = float(np.median(scale)) if r else 1.0  # 1/s, from metres to velocities
    width = (0, count + fixed)
    A, out, back = np.pad(A, (width, width)), np.pad(out, ((0, 0), width)), np.pad(back, (width, (0, 0)))
    if active.nonsymmetric:
        skew = psi.T @ (active.force_direction - active.shape).T
        A[r : 2 * r, :r] -= (skew * active.stiffness) @ extension / scale
        A[r : 2 * r, r : 2 * r] -= (skew * active.dashpot) @ extension
    if constrained is not None:
        springs = (active.force_direction.T * active.stiffness) @ (active.shape @ constrained)
        A[r : 2 * r, first:] = -psi.T @ (system.stiffness[:, None] * constrained + springs) / typical
        out[:n, first:], back[first:, :n] = constrained / typical, constrained.T * typical
    if together:
        unit = typical / max(float(np.abs(contacts.shape).max()), TINY)
        states, (forces, by_penetration, by_rate) = slice(2 * r, first), _internal_coupling(equations, active, undamped)
        A[r : 2 * r, states] = forces / unit
        A[states, :r] = unit * by_penetration / scale
        A[states, r : 2 * r] = unit * by_rate
        A[states, states] = equations.internal_rates[:, equations.equations.internal]
        if constrained is not None:
            closed = (contacts.sign[:, None] * contacts.shape @ constrained)[contacts.state_owner]
            A[states, first:] = -unit / typical * (equations.internal_rate_factors[:, PENETRATION, None] * closed)
        out[2 * n :, states] = np.eye(count) / unit
        back[states, 2 * n :] = np.eye(count) * unit
    return block_diagonalise(A, window).transform(out, back)


def _internal_coupling(
    equations: StateEquations, active: _ActiveContacts, undamped: _UndampedModes
) -> tuple[Floats, Floats, Floats]:
    """Coupling matrices between s internal states and r modes.

    Parameters
    ----------
    equations, active, undamped : as for `_general_modes`.

    Returns
    -------
    pushed : (r, s) force on each mode for a unit of each internal state.
    by_penetration, by_rate : (s, r) rate of each internal state for a unit of each mode, and of its velocity.
    """
    contacts, drive = equations.equations.contacts, equations.internal_rate_factors
    deflection = contacts.shape @ undamped.shapes
    # of stiff ones in slow motions, and none in motions that do not move them
    deflection[active.contact] = undamped.extension
    penetration = -contacts.sign[:, None] * deflection
    pushes = equations.push @ undamped.shapes if active.nonsymmetric else -penetration
    return (
        pushes[contacts.state_owner].T * equations.internal_factors,
        drive[:, PENETRATION, None] * penetration[contacts.state_owner],
        drive[:, RATE, None] * penetration[contacts.state_owner],
    )


NO_STIFFNESS = 1e-13  # relative to the largest squared frequency; smaller negative ones are round-off


class _UndampedModes(NamedTuple):
    """Undamped modes of the structure with the springs of active contacts, and the damping matrix between them."""

    omega_squared: Floats  # (e,) rad^2/s^2; negative where a force falls faster than the structure's rises
    shapes: Floats  # (n, e) orthonormal
    extension: Floats  # (a, e) deflection at each acting contact
    damping: Floats  # (e, e)


def _undamped_modes(
    system: PiecewiseLinearSystem, active: _ActiveContacts, constrained: Floats | None
) -> _UndampedModes:
    """Undamped modes of the structure with the springs of active contacts, motions ``constrained`` (n, n - e) excluded.

    Rigid-body motions that no contact resists stay exact.
    """
    n, phi, k = system.size, active.shape, active.stiffness
    if not k.size and constrained is None:
        return _UndampedModes(system.stiffness, np.eye(n), phi, system.damping)
    basis, rigid = np.eye(n), np.zeros((n, 0))
    if (system.stiffness == 0.0).any():
        basis, rigid = _with_rigid_motions(system, phi if constrained is None else np.vstack([phi, constrained.T]))
    if constrained is not None:
        basis = basis @ np.linalg.svd(constrained.T @ basis)[2][constrained.shape[1] :].T
    if np.any(k < 0.0) or np.any(system.stiffness < 0.0):
        omega2, psi = np.linalg.eigh(basis.T @ (np.diag(system.stiffness) + (phi.T * k) @ phi) @ basis)
        omega2[(omega2 < 0.0) & (omega2 >= -NO_STIFFNESS * np.abs(omega2).max(initial=0.0))] = 0.0
        extension = phi @ basis @ psi
    else:
        # singular values of a factor: eigenvalues of K would have errors of the order of the highest one in the lowest
        springs = np.sqrt(k)[:, None] * phi
        factor = np.vstack([np.diag(np.sqrt(system.stiffness)), springs]) @ basis
        left, omega, right = np.linalg.svd(factor, full_matrices=False)
        omega2, psi = omega[::-1] ** 2, right[::-1].T
        # the springs' extensions too: in a low mode that of a stiff spring is below the round-off of phi @ psi
        extension = phi @ basis @ psi
        elastic = k > 0.0
        extension[elastic] = (left[n:] * omega)[elastic, ::-1] / np.sqrt(k[elastic])[:, None]
    free = rigid.shape[1]
    shapes, extension = np.hstack([rigid, basis @ psi]), np.hstack([np.zeros((k.size, free)), extension])
    damping = shapes.T @ system.damping @ shapes + (extension.T * active.dashpot) @ extension
    return _UndampedModes(np.append(np.zeros(free), omega2), shapes, extension, damping)


def _with_rigid_motions(system: PiecewiseLinearSystem, contact_shapes: Floats) -> tuple[Floats, Floats]:
    """Motions that contacts with shapes (a, n) or springs of the structure resist, then free rigid-body motions."""
    rigid, basis = np.flatnonzero(system.stiffness == 0.0), np.eye(system.size)
    _, singular, right = np.linalg.svd(contact_shapes[:, rigid])
    rank = int(np.sum(singular > 1e-12 * max(float(singular.max(initial=0.0)), TINY)))
    free = rigid.size - rank
    basis[np.ix_(rigid, rigid)] = right.T
    basis = basis[:, np.concatenate([rigid[rank:], rigid[:rank], np.flatnonzero(system.stiffness != 0.0)])]
    return basis[:, free:], basis[:, :free]


def _residual(factors: Complexes, equations: StateEquations, sources: Sources) -> Complexes:
    """(F, degree + 1, N) residual of the forced responses ``factors`` (F, D, N) in the equation of motion.

    It is a polynomial times ``e^{nu tau}``.
    """
    eq, power, F, degrees = equations.equations, sources.power, np.arange(sources.power.size), sources.power.max() + 1
    y, higher = factors[:, :degrees], factors[:, 1 : degrees + 1]
    z = np.zeros((F.size, degrees, eq.width), dtype=complex)
    z[:, :, : eq.states], z[F, power, eq.inputs.start + F] = y, 1.0
    z[F, power, eq.slopes.start + F] = sources.exponent
    if degrees > 1:
        rising = np.flatnonzero(power)
        z[rising, power[rising] - 1, eq.slopes.start + rising] = power[rising]
    out = equations.rates_at(z.reshape(-1, eq.width).T).T.reshape(y.shape) - sources.exponent[:, None, None] * y
    if degrees > 1 or higher.shape[1]:
        out[:, : higher.shape[1]] -= np.arange(1, higher.shape[1] + 1)[:, None] * higher
        out[np.arange(degrees) > power[:, None]] = 0.0
    return np.asarray(out)


def _response_of_block(
    block: Block, polynomial: Complexes, nu: complex, window: float, limit: float
) -> Iterator[tuple[int, Complexes]]:
    """Powers of time and factors (N,) of the response of one block to ``sum_p polynomial[p] tau^p e^{nu tau}``.

    Parameters
    ----------
    block, polynomial : the block and the load (degree + 1, N).
    nu : exponent, 1/s.
    window, limit : for how long, s, the response must hold, and up to where it is a power series.
    """
    for b in (block, block.conjugate()) if block.weight == 2.0 else (block,):
        beta = b.left @ polynomial.T
        m = b.matrix.shape[0]
        if abs(nu - b.centre) * window < max(limit, 1.0) + b.radius * window:
            for power, v in _power_series(b.matrix - nu * np.eye(m), beta, window):
                yield power, b.right @ v
            continue
        w = np.zeros(m, dtype=complex)
        for p in range(beta.shape[1] - 1, -1, -1):
            w = np.linalg.solve(nu * np.eye(m) - b.matrix, beta[:, p] - (p + 1) * w)
            yield p, b.right @ w


def _power_series(matrix: Complexes, beta: Complexes, window: float) -> Iterator[tuple[int, Complexes]]:
    """Powers and coefficients (m,) of the z that starts from zero, ``z' = matrix z + sum_p beta[:, p] tau^p``."""
    degree = beta.shape[1] - 1
    v = np.zeros(beta.shape[0], dtype=complex)
    largest = np.zeros(beta.shape[0])
    for q in range(200):
        v = matrix @ v / (q + 1)
        if q <= degree:
            v += beta[:, q] / (q + 1)
        if np.any(v):
            yield q + 1, v
        size = np.abs(v) * (window ** (q + 1) if np.isfinite(window) else 1.0)
        largest = np.maximum(largest, size)
        if q > degree and np.all(size <= SMALLEST_TERM * largest.max()):
            return
    raise ArithmeticError("the power series of a response did not converge")


def _series(block: Block, window: float) -> list[Complexes]:
    """Terms N^k / k! of the exponential series of a block, until they are negligible over the window."""
    m = block.matrix.shape[0]
    N = block.matrix - block.centre * np.eye(m)
    series = [np.eye(m, dtype=complex)]
    largest = 1.0
    for k in range(1, 200):
        term = series[-1] @ N / k
        size = float(np.max(np.abs(term))) * (window**k if np.isfinite(window) else 1.0)
        largest = max(largest, size)
        if size <= SMALLEST_TERM * largest:
            return series
        series.append(term)
    raise ArithmeticError("the power series of a cluster of eigenvalues did not converge")
