"""Scenes: camera, lights, materials, sky, fog, parameters, quality, and the `Scene` that holds them."""

from raymarch.scene.ambient_occlusion import AmbientOcclusion
from raymarch.scene.camera import Camera
from raymarch.scene.data import colormap, sampled
from raymarch.scene.file import load as load
from raymarch.scene.fog import Fog
from raymarch.scene.light import DirectionSample, Light
from raymarch.scene.light_kinds import PointLight, RectLight, SphereLight, SpotLight, Sun
from raymarch.scene.material import Material
from raymarch.scene.medium import Medium
from raymarch.scene.parameter import Param, time
from raymarch.scene.pattern import checker, grid_lines, marble, noise, stripes
from raymarch.scene.post import Bloom
from raymarch.scene.quality import Quality
from raymarch.scene.scene import Scene
from raymarch.scene.sky import GradientSky, ImageSky, Sky, SunSky
from raymarch.scene.texture import Texture, planar, triplanar
from raymarch.scene.tone import ToneMapping
from raymarch.scene.tracer import TracerState

__all__ = [
    "AmbientOcclusion",
    "Bloom",
    "Camera",
    "DirectionSample",
    "Fog",
    "GradientSky",
    "ImageSky",
    "Light",
    "Material",
    "Medium",
    "Param",
    "PointLight",
    "Quality",
    "RectLight",
    "Scene",
    "Sky",
    "SphereLight",
    "SpotLight",
    "Sun",
    "SunSky",
    "Texture",
    "ToneMapping",
    "TracerState",
    "checker",
    "colormap",
    "grid_lines",
    "marble",
    "noise",
    "planar",
    "sampled",
    "stripes",
    "time",
    "triplanar",
]
