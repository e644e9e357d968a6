"""Charged particles through the sensor: each leaves a track of charge in the frame that it hits.

Energy loss: Review of Particle Physics, section "Passage of particles through matter", equations
for the mean (Bethe) and for the most probable loss in a thin layer (Landau), whose distribution is
approximated by Moyal's. Neither includes fast secondary electrons that leave a layer this thin;
those are drawn separately (delta rays, the same section), with the range of Kanaya and Okayama,
J. Phys. D 5 (1972) 43. Assumed: directions are isotropic, so that the density of the cosine of
the angle of incidence rises with it; tracks are straight. Not modelled: the density effect, nuclear
reactions, ions heavier than protons.
"""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from cubestack.emulator.camera.common.hazards.contract import Exposure, Field, SensorHazard
from cubestack.emulator.scene.hazards.hazard import Strength
from cubestack.firmware_model.values import choice, number, whole

Numbers = NDArray[np.float64]


@dataclass(frozen=True)
class Population:
    """Protons behind the walls of a satellite."""

    hits_cm2_s: float  #: through a flat sensor, from both sides
    median_mev: float  #: median energy; its logarithm has a normal distribution
    spread: float  #: standard deviation of that, as a factor on the energy


ORBITS = {
    "quiet": Population(1.0, 1500.0, 2.0),
    "anomaly": Population(500.0, 60.0, 2.5),
    "solar": Population(3000.0, 40.0, 2.0),
}
"""Chosen to the order of magnitude.

Quiet: galactic cosmic rays, the part of 4 / (cm2 s) that the magnetic field lets into a low orbit.
Anomaly: the heart of the South Atlantic anomaly 500 to 800 km up, where the model AP-8 has some
1000 / (cm2 s) beyond 30 MeV from all sides, of which a flat sensor meets half. Solar: over a pole
at the peak of an event as in October 1989, some 1000 / (cm2 s sr) beyond 30 MeV from above.
"""

SLOWEST_MEV, FASTEST_MEV = 5.0, 1e5
STEEPEST = 0.02
"""Smallest cosine of the angle of incidence: the path is then fifty times the layer's depth."""

ELECTRON_MASS_EV, PROTON_MASS_MEV = 0.511e6, 938.272
SILICON_EV = 173.0  # mean excitation energy
SILICON_XI_KEV_UM = 0.01783
"""Half of 0.307 MeV cm2/g, by Z / A = 0.498 and 2.33 g/cm3."""

PAIR_EV = 3.65  # per freed electron, silicon
MOYAL_MEAN = 1.2704  # Euler's constant plus ln 2
DELTA_KEV = 10.0
"""Faster secondary electrons are drawn individually (chosen): they leave the proton's track."""

DIFFUSION_UM = 2.0
"""Standard deviation of the charge's sideways diffusion (assumed)."""

PACKETS_PER_PX = 64  # of a track's charge


@dataclass(frozen=True, kw_only=True)
class Protons(SensorHazard):
    """Tracks of protons, new ones in each frame."""

    meaning = "tracks of protons, new ones in each exposure"
    strength = Strength("hits", "a frame", (0, 3, 10, 30, 100, 300), 100)

    orbit: str = choice(
        "anomaly", "quiet, over the South Atlantic anomaly, or in a solar event", tuple(ORBITS)
    )
    hits: int | None = whole(
        None, "tracks per frame; if omitted, by orbit, area and exposure", 0, 20_000
    )
    depth_um: float = number(8.0, "of the layer that collects charge", 1, 50)

    def mean_hits(self, exposure: Exposure) -> float:
        rate = ORBITS[self.orbit].hits_cm2_s * exposure.area_cm2
        return rate * exposure.seconds if self.hits is None else self.hits

    def charge(self, exposure: Exposure, generator: np.random.Generator) -> Field | None:
        """Tracks of one frame: a Poisson number, or ``hits`` if given."""
        count = generator.poisson(self.mean_hits(exposure)) if self.hits is None else self.hits
        if not count:
            return None
        population = ORBITS[self.orbit]
        energies = population.median_mev * population.spread ** generator.standard_normal(count)
        energies = np.clip(energies, SLOWEST_MEV, FASTEST_MEV)
        cosine = np.maximum(np.sqrt(generator.random(count)), STEEPEST)
        paths = self.depth_um / cosine
        rows, columns = exposure.shape
        middle = generator.random((count, 2)) * (columns, rows) - 0.5
        along = _random_vectors(paths * np.sqrt(1 - cosine**2) / exposure.pitch_um, generator)
        starts, kev = middle - along / 2, lost_kev(energies, paths, generator)
        who, fast_kev, reach = _deltas(energies, paths, self.depth_um, generator)
        fast = starts[who] + generator.random((len(who), 1)) * along[who]
        aside = _random_vectors(reach / exposure.pitch_um, generator)
        return _tracks(
            np.concatenate([starts, fast]),
            np.concatenate([along, aside]),
            np.concatenate([kev, fast_kev]) * (1000 / PAIR_EV),
            exposure,
            generator,
        )


def mean_loss_kev(energies_mev: Numbers, paths_um: Numbers) -> Numbers:
    """Mean energy (n,) that protons lose along a path through silicon."""
    beta2, momentum2 = _speed(energies_mev)
    largest = _largest_delta_ev(energies_mev)
    logarithm = np.log(2 * ELECTRON_MASS_EV * momentum2 * largest / SILICON_EV**2)
    return np.asarray(SILICON_XI_KEV_UM * paths_um / beta2 * (logarithm - 2 * beta2))


def lost_kev(energies_mev: Numbers, paths_um: Numbers, generator: np.random.Generator) -> Numbers:
    """Energy (n,) that protons leave near their path through thin silicon, random."""
    beta2, momentum2 = _speed(energies_mev)
    xi = SILICON_XI_KEV_UM * paths_um / beta2
    logarithm = np.log(2 * ELECTRON_MASS_EV * momentum2 / SILICON_EV * xi * 1000 / SILICON_EV)
    # In a layer that stops the largest delta ray, Landau's tail would lose too much energy.
    likely = np.minimum(
        xi * (logarithm + 0.2 - beta2), mean_loss_kev(energies_mev, paths_um) - MOYAL_MEAN * xi
    )
    moyal = -np.log(generator.standard_normal(len(xi)) ** 2)
    return np.asarray(np.maximum(likely + xi * moyal, 0))


def _deltas(
    energies_mev: Numbers, paths_um: Numbers, depth_um: float, generator: np.random.Generator
) -> tuple[NDArray[np.int64], Numbers, Numbers]:
    """Delta rays: index of the proton, energy left in the layer (keV), distance across it (um)."""
    beta2, _ = _speed(energies_mev)
    largest = _largest_delta_ev(energies_mev) / 1000
    share = np.maximum(1 - DELTA_KEV / largest, 0)
    rays = generator.poisson(SILICON_XI_KEV_UM * paths_um / beta2 / DELTA_KEV * share)
    who = np.repeat(np.arange(len(rays)), rays)
    kev = DELTA_KEV / (1 - generator.random(len(who)) * share[who])
    ranges = 0.0319 * kev**1.67  # um: Kanaya and Okayama, silicon
    cosine = generator.uniform(-1, 1, len(who))
    inside = np.minimum(ranges, depth_um / 2 / np.maximum(np.abs(cosine), STEEPEST))
    return who, kev * inside / ranges, inside * np.sqrt(1 - cosine**2)


def _speed(energies_mev: Numbers) -> tuple[Numbers, Numbers]:
    """Squares (n,) of speed and of momentum by mass, in units of the speed of light."""
    gamma = 1 + energies_mev / PROTON_MASS_MEV
    return 1 - gamma**-2, gamma**2 - 1


def _largest_delta_ev(energies_mev: Numbers) -> Numbers:
    gamma = 1 + energies_mev / PROTON_MASS_MEV
    ratio = ELECTRON_MASS_EV / (PROTON_MASS_MEV * 1e6)
    return np.asarray(2 * ELECTRON_MASS_EV * (gamma**2 - 1) / (1 + 2 * gamma * ratio + ratio**2))


def _random_vectors(lengths: Numbers, generator: np.random.Generator) -> Numbers:
    """Vectors (n, 2) of these lengths in random directions."""
    angles = 2 * math.pi * generator.random(len(lengths))
    vectors = np.stack([np.cos(angles), np.sin(angles)], axis=1)
    return np.asarray(lengths[:, None] * vectors)


def _tracks(
    starts: Numbers,
    along: Numbers,
    electrons: Numbers,
    exposure: Exposure,
    generator: np.random.Generator,
) -> Field:
    """Charge (rows, columns) of even tracks from ``starts``, px (n, 2), in packets that diffuse."""
    packets = np.ceil(PACKETS_PER_PX * (1 + np.hypot(*along.T))).astype(np.int64)
    track = np.repeat(np.arange(len(packets)), packets)
    first = np.cumsum(packets) - packets
    share = (np.arange(len(track)) - first[track] + 0.5) / packets[track]
    places = starts[track] + share[:, None] * along[track]
    places += DIFFUSION_UM / exposure.pitch_um * generator.standard_normal(places.shape)
    x, y = np.rint(places).astype(np.int64).T
    rows, columns = exposure.shape
    inside = (x >= 0) & (x < columns) & (y >= 0) & (y < rows)
    image: Field = np.zeros(exposure.shape, np.float32)
    weights = (electrons / packets)[track[inside]].astype(np.float32)
    np.add.at(image.ravel(), y[inside] * columns + x[inside], weights)
    return image
