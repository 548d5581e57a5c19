"""``multiphi-exudyn needs``: levels, coordinates and memory of the reduced run of a scene."""

from __future__ import annotations

from collections.abc import Sequence

from tqdm import tqdm

from multiphi_exudyn.study.running.needs import needs_of, needs_table
from multiphi_exudyn.study.scene import load_scene, shipped_scenes
from multiphi_exudyn.time.model_warnings import grouped

__all__ = ["run_needs"]


def run_needs(sources: Sequence[str]) -> bool:
    """Print a line for every scene, or for all shipped scenes without a name; return True if all ran."""
    scenes = [load_scene(source) for source in sources or shipped_scenes()]
    all_needs = [needs_of(scene) for scene in tqdm(scenes, disable=None, unit="scene")]
    print(needs_table(all_needs))
    for group in grouped((needs.scene, needs.warnings) for needs in all_needs):
        print(f"warning: {group.told(len(all_needs))}")
    return all(needs.status == "ok" for needs in all_needs)
