"""The session of the demo goes into the wheel; an editable install finds it in the checkout."""

from typing import Any

from hatchling.builders.hooks.plugin.interface import BuildHookInterface


class FixtureHook(BuildHookInterface):
    """Adds fixtures/bumpy as `rgbn.examples.fixture_folder` looks for it."""

    def initialize(self, version: str, build_data: dict[str, Any]) -> None:
        """Add it to a wheel that is installed as a copy."""
        if version == "standard":
            build_data["force_include"]["fixtures/bumpy"] = "rgbn/fixture"
