"""``multiphi-exudyn needs``: what the reduced run of a scene takes of what it could take."""

from __future__ import annotations

from collections.abc import Sequence

from tqdm import tqdm

from multiphi_exudyn.study.running.needs import needs_of, needs_table
from multiphi_exudyn.study.scene.scenes import load_scene, shipped_scenes
from multiphi_exudyn.time.warning_groups import grouped

__all__ = ["run_needs"]


def run_needs(sources: Sequence[str]) -> bool:
    """Print a line for every scene, all shipped ones for none named; True if all of them ran."""
    scenes = [load_scene(source) for source in sources or shipped_scenes()]
    found = [needs_of(scene) for scene in tqdm(scenes, disable=None, unit="scene")]
    print(needs_table(found))
    for group in grouped((needs.scene, needs.warnings) for needs in found):
        print(f"warning: {group.told(len(found))}")
    return all(needs.status == "ok" for needs in found)
