"""Makes the models before the package is built, also where it is installed from its folder or edited in place."""

import sys
from pathlib import Path

from hatchling.builders.hooks.plugin.interface import BuildHookInterface


class CustomBuildHook(BuildHookInterface):
    def initialize(self, version: str, build_data: dict) -> None:
        sys.path.insert(0, self.root)
        from generate import generate

        generate(Path(self.root) / "src" / "precut" / "models.py")
