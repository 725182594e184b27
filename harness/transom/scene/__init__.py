"""Scenes: reading, checking and naming what every renderer receives."""

from transom.scene.content import content_key
from transom.scene.loader import list_scenes, load_scene, scene_root
from transom.scene.regions import region_mask

__all__ = ["content_key", "list_scenes", "load_scene", "region_mask", "scene_root"]
