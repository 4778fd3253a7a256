"""What a method is, and what it is given; every method by its name."""

import importlib
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from scene.errors import SceneError
from scene.method_names import FAMILIES, METHODS
from solve.problem import Problem

if TYPE_CHECKING:
    from solve.samples import Samples

Settings = Any
"""A NamedTuple of a method's own, each field with its default: kernels take it as it is."""
NO_SETTINGS: Settings = NamedTuple("NoSettings", [])()


@dataclass(frozen=True)
class Whole:
    """What a method that fits all pixels together returns.

    Parameters
    ----------
    b : (P, 3) float64
        Albedo x normal; zero or NaN where unknown.
    used : (P, F) bool
        The samples that it is based on.
    cautions : tuple of str
    lights : (F, 3) float64 or None
        Direction times intensity, of methods that recover the lights too.
    shade : (P, F) float64 or None
        What is seen of albedo 1 where it is not Lambert's n . l.
    sigma_deg : (P,) float64 or None
        The normals' standard deviation, degrees along one axis; None: as `solve.assess.sigma_deg` has it.
    """

    b: NDArray[np.float64]
    used: NDArray[np.bool_]
    cautions: tuple[str, ...] = ()
    lights: NDArray[np.float64] | None = None
    shade: NDArray[np.float64] | None = None
    sigma_deg: NDArray[np.float64] | None = None


@dataclass(frozen=True)
class Method:
    """One method: either `fit` or `fit_whole`, the other parts as it needs them.

    Parameters
    ----------
    name : str
    profiles : mapping of str to NamedTuple
        Settings: `default`, which serves best, and `seed`, the plain reading of the benchmark's text, where a method
        breaks as it breaks there [Berkiten2016]; absent: the default. A method may have more.
    fit : callable, optional
        (samples, scale, settings) -> b (P, 3) float64, used (P, F) bool, of any pixels: `solve.samples.Samples`; the
        stack's 99th percentile, to which every threshold is relative; b = albedo x normal, zero where the lit lights
        do not span space; the samples that b is based on. A compiled kernel, as a rule.
    fit_whole : callable, optional
        (problem, samples, settings) -> Whole, of all pixels of the mask. Its memory grows with the samples.
    prepare : callable, optional
        (problem, settings) -> Problem, before the fit: finds lights or depth, or adds cautions.
    is_calibrated : bool
        Needs the lights' directions. Otherwise they are hidden from it.
    is_linear : bool
        `fit` is least squares on samples that it does not choose by their residuals: these tell sigma as they are.
    """

    name: str
    profiles: Mapping[str, Settings]
    fit: Callable[["Samples", float, Settings], tuple[NDArray, NDArray]] | None = None
    fit_whole: Callable[[Problem, "Samples", Settings], Whole] | None = None
    prepare: Callable[[Problem, Settings], Problem] | None = None
    is_calibrated: bool = True
    is_linear: bool = False

    def settings(self, profile: str) -> Settings:
        """Return the settings of a profile.

        Raises
        ------
        SceneError
            The method has no such profile.
        """
        default = self.profiles["default"]
        profiles = {"default": default, "seed": default, **self.profiles}
        if profile not in profiles:
            raise SceneError(f"solve: {self.name} has no profile {profile!r}; there are {', '.join(profiles)}.")
        return profiles[profile]


def method_of(name: str) -> Method:
    """Return a method of the table.

    Raises
    ------
    SceneError
        There is none of this name.
    """
    if name not in FAMILIES:
        raise SceneError(f"solve: unknown method {name!r}; there are {', '.join(METHODS)}.")
    return importlib.import_module(f"solve.{FAMILIES[name]}.{name}").METHOD
